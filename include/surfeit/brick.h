// Brick maps: baked values of clouds (occlusion, irradiance, any channel) in a multiresolution
// OpenVDB file, with look-ups at any place: the counterpart of brickmake and texture3d.
// docs/brick.md describes the file and the computation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/color_range.h"
#include "surfeit/forecast.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// The most numbers per point that a brick map keeps, over all its channels.
inline constexpr std::size_t kMaxBrickValues = 64;

// `memory_bytes`: at least 64 MiB; 0 stands for 1 GiB, or for three quarters of the memory that the
// job may hold where that is less.
struct BrickOptions : JobOptions {
  // Channels or properties to keep. Empty: the outputs of a gather that the first cloud has; if it
  // has none, all channels except the geometry of the points.
  std::vector<std::string> channels;
  // A voxel is divided where a number of a channel differs by more than this within it. 0 keeps
  // every voxel of the finest level.
  double max_error = 0.01;
  // Edge of the finest voxels, scene units. 0: twice the spacing of the points, from the median of
  // their areas, or from their density where they have no sizes.
  double voxel_size = 0;
  // Condition for the records to read, "classification == 2" (docs/files.md, "Filters"). Empty: all
  // records but those that the format marks as unusable.
  std::string filter{};
  // Meaning of color numbers where the file does not state it.
  ColorRange color_range = ColorRange::kAuto;
};

struct BrickStats {
  std::uint64_t memory_bytes = 0;  // the budget
  std::uint64_t points = 0;        // records of the inputs
  std::uint64_t skipped_points = 0;
  std::vector<std::string> channels;
  double voxel_size = 0;                    // of level 0, the finest
  std::vector<std::uint64_t> level_voxels;  // written, directions counted each; level 0 first
  std::uint64_t file_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // written to temporary files
  int threads = 0;
  std::vector<std::pair<std::string, double>> phase_seconds;
};

// Writes `output`, an OpenVDB file, from the points of all inputs (clouds of any format, docs/
// files.md). The file depends only on the points and on the members of BrickOptions itself, bit for
// bit, not on the order of the points or of the inputs. It appears under its name only when
// complete. Errors:
// kInvalidArgument (options; a channel that an input lacks), kCorruption (bad input, or no valid
// point at all), kBudgetTooSmall, kIoError, kInterrupted.
SURFEIT_API Result<BrickStats> brickClouds(const std::vector<std::string>& inputs,
                                           const std::string& output, const BrickOptions& options,
                                           Progress& progress);

// What brickClouds takes, by the points in some blocks of 16 voxels along each axis: reads the
// clouds twice, or three times, and makes a brick map of those points in a temporary folder.
// Writes nothing else. Errors: as brickClouds.
SURFEIT_API Result<SampleForecast> forecastBrick(const std::vector<std::string>& inputs,
                                                 const std::string& output,
                                                 const BrickOptions& options, Progress& progress);

// A channel of a brick map.
struct BrickChannel {
  std::string name;                     // irradiance
  std::vector<std::string> properties;  // irradiance_r irradiance_g irradiance_b
};

// An open brick map. Safe from any thread.
class SURFEIT_API BrickMap {
 public:
  // Reads the file once, to find its pages. `memory_bytes` holds a list of the pages (12 bytes per
  // leaf of 8^3 voxels, and 8 more for every grid) and a cache of pages that look-ups need. Errors:
  // kIoError, kCorruption (no brick map, or a damaged one), kBudgetTooSmall with the least budget
  // that works.
  static Result<BrickMap> open(const std::string& path,
                               std::uint64_t memory_bytes = std::uint64_t{64} << 20);
  BrickMap(BrickMap&&) noexcept;
  BrickMap& operator=(BrickMap&&) noexcept;
  ~BrickMap();

  const std::vector<BrickChannel>& channels() const;
  // Numbers that a look-up returns: all channels, in their order.
  std::size_t valueCount() const;
  // Level 0 is the finest.
  int levelCount() const;
  double voxelSize(int level) const;

  // The values at `position` on a surface with that normal, or on any surface where the normal is
  // zero, averaged over about `filter_width` scene units; 0 takes the finest level there. Linear
  // between voxels and between levels. `values` has valueCount() numbers. Returns false and zeros
  // where no point that faces that way is within reach of the coarsest voxels. The first look-up of
  // a page reads it. Errors: kIoError, kCorruption.
  Result<bool> lookup(const glm::dvec3& position, const glm::vec3& normal, double filter_width,
                      float* values) const;

  // Bytes of the pages in the cache now, and bytes of the list of pages.
  std::uint64_t cachedBytes() const;
  std::uint64_t directoryBytes() const;

 private:
  struct State;
  explicit BrickMap(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
