// Points of clouds as a brick map takes them: position, normal, area and the chosen channels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/row_reader.h"
#include "surfeit/brick.h"
#include "surfeit/color_range.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct BrickInputPoint {
  glm::dvec3 position{0};
  glm::vec3 normal{0};  // unit; zero: none
  double area = 0;      // 0: the cloud has no sizes
  std::span<const float> values;
};

// Chooses the channels of a brick map by a cloud. kInvalidArgument lists those that it has when one
// is missing, and for more numbers than kMaxBrickValues.
Result<std::vector<BrickChannel>> chooseBrickChannels(const RowLayout& element,
                                                      std::span<const std::string> names,
                                                      const std::string& path);

// One cloud. One thread at a time.
class BrickInput {
 public:
  // kInvalidArgument when the cloud lacks a channel, kCorruption when it has no positions.
  static Result<BrickInput> open(const std::string& path, std::span<const BrickChannel> channels,
                                 const RowReaderOptions& reading = {});

  const std::string& path() const { return reader_->path(); }
  const RowReader& reader() const { return *reader_; }
  bool hasSizes() const { return !area_.empty() || !radius_.empty(); }
  bool hasNormals() const { return has_normals_; }

  // All valid points from the first. Invalid ones are counted and told, unless `skipped` is
  // nullptr; with `strict` the first is refused.
  Status forEach(bool strict, Progress& progress, std::uint64_t* skipped,
                 const std::function<Status(const BrickInputPoint&)>& visit);

 private:
  // A number that the points take from a row.
  struct Value {
    RowChannel channel;
    std::size_t component = 0;
  };
  struct Field {
    std::size_t offset = 0;
    ValueType type = ValueType::kFloat32;
    bool exists = false;
    bool empty() const { return !exists; }
    double read(const std::byte* row) const { return rowValue(row + offset, type); }
  };

  BrickInput() = default;
  Status declare(std::span<const BrickChannel> channels);
  Field find(const char* name) const;
  const char* decode(const std::byte* row, BrickInputPoint& point);

  std::unique_ptr<RowReader> reader_;
  std::array<Field, 3> position_, normal_;
  Field area_, radius_;
  double radius_scale_ = 1;
  bool has_normals_ = false;
  std::vector<Value> values_;
  std::vector<Field> plain_;  // of values that are floats as they stand; empty: it is not
  std::vector<float> point_values_;
  AlignedBuffer buffer_;
};

// What one look at all points tells.
struct BrickExtent {
  glm::dvec3 least{std::numeric_limits<double>::infinity()};
  glm::dvec3 greatest{-std::numeric_limits<double>::infinity()};
  std::uint64_t points = 0;
  std::vector<float> low, high;  // of each value

  void add(const BrickInputPoint& point);
  double size() const;  // longest edge
};

// The median of areas, of points in any order: to 1/16 of an octave.
class AreaMedian {
 public:
  void add(double area);
  double median() const;

 private:
  static constexpr int kBinsPerOctave = 16, kLeastOctave = -128, kOctaves = 256;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(kBinsPerOctave * kOctaves);
  std::uint64_t count_ = 0;
};

// The area of a point by how many cells the points lie in, for clouds without sizes. Takes 16 MiB.
class OccupancyArea {
 public:
  explicit OccupancyArea(const BrickExtent& extent);
  void add(const glm::dvec3& position);
  double area() const;

 private:
  static constexpr int kLevels = 9;
  glm::dvec3 origin_;
  double cell_ = 1;
  std::uint64_t count_ = 0;
  std::vector<std::uint64_t> bits_;
};

}  // namespace surfeit
