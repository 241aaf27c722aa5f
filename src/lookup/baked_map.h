// A map of baked values of either kind: a brick map, or the points of a cloud.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lookup/baked_points.h"
#include "lookup/baked_search.h"
#include "surfeit/brick.h"
#include "surfeit/lookup.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Whether it is an OpenVDB file whose grids say that they are a brick map. A file that does not
// open is none: whoever reads it as a cloud tells the reason.
bool isBrickMap(const std::string& path);

// What a map may take.
struct BakedMapMemory {
  std::uint64_t open_bytes = 0, hold_bytes = 0;  // while it is opened, and afterwards
  int threads = 1;
  std::uint64_t beside_bytes = 0;  // as BakedPoints::Options
  std::string temporary_directory;
};

// Safe from any thread once it is open.
class BakedMap {
 public:
  static Result<BakedMap> open(const std::string& path, const LookupOptions& options,
                               const BakedMapMemory& memory, Progress& progress);

  // The properties that a look-up finds, and their channels.
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<std::string>& channels() const { return channels_; }
  // What is known of the map now.
  void describe(LookupStats& stats) const;

  // A thread's way into the map.
  class Reader {
   public:
    explicit Reader(const BakedMap& map);
    // names().size() floats. False, and nothing written, where the map has nothing nearby.
    Result<bool> find(const glm::dvec3& position, const glm::vec3& normal, std::span<float> values);

   private:
    const BakedMap& map_;
    std::optional<BakedSearch> search_;  // of points
    std::vector<float> all_;             // of a brick map
  };

 private:
  Status chooseOfBrick(const std::string& path, std::span<const std::string> wanted);
  void takePoints(const LookupOptions& options, const std::string& path, Progress& progress);

  std::optional<BrickMap> brick_;
  std::vector<std::size_t> chosen_;  // of the values of a brick map
  double filter_width_ = 0;
  std::unique_ptr<BakedPoints> points_;
  LookupInterpolation interpolation_ = LookupInterpolation::kSmooth;
  double reach_ = 0;
  std::vector<std::string> names_, channels_;
};

}  // namespace surfeit
