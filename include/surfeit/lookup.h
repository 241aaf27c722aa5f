// Values that were baked at points, looked up at receivers: the counterpart of texture3d and
// bake3d (app note, sections 7 and 8). docs/brick.md, "Looking up at receivers".
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/forecast.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// How the points of a baked cloud make the value at a receiver. Voxels of a brick map are always
// interpolated linearly.
enum class LookupInterpolation : std::uint8_t {
  kSmooth,   // the 8 nearest points, by (1 - distance / distance of the 9th)^2
  kNearest,  // the nearest point
};

// The rows of an affine 3x4 matrix: x' = m[0] x + m[1] y + m[2] z + m[3].
using LookupMatrix = std::array<double, 12>;
inline constexpr LookupMatrix kIdentityMatrix = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

// `memory_bytes`: 0 stands for 1 GiB, or for three quarters of the memory that the job may hold
// where that is less. Temporary files hold the points of a baked cloud, along a curve. `strict`
// refuses invalid records instead of leaving them out. ReadOptions are for the receivers.
struct LookupOptions : JobOptions, ReadOptions {
  // Channels or single properties of the map that receivers get. Empty: all of a brick map; of a
  // cloud the outputs of a gather, else all channels but the geometry.
  std::vector<std::string> values{};
  // New names for channels of a baked cloud, "FROM=TO,FROM=TO", and the condition for its records.
  std::string map_channels{}, map_filter{};

  LookupInterpolation interpolation = LookupInterpolation::kSmooth;
  // Points of a baked cloud that are farther away count for nothing; units of the map. 0: 8 times
  // the spacing of the points, which is told.
  double max_distance = 0;
  // Of a brick map: width over which values are averaged, units of the map. 0: the finest level.
  double filter_width = 0;
  // What a receiver without a value gets: NaN, or a number of choice.
  float missing = std::numeric_limits<float>::quiet_NaN();

  // Where the object stood when values were baked (to_space), and where it stands now (from_space):
  // matrices from the object's own space to that of the map and to that of the receivers. A place
  // is looked up at to_space * inverse(from_space) * position; normals turn along, and values that
  // are points, vectors, directions or sizes come back the other way, as ConvertOptions::transform
  // has it. Both can be inverted.
  LookupMatrix from_space = kIdentityMatrix, to_space = kIdentityMatrix;
  // Channel of reference positions, "Pref": receivers are looked up there, which finds values on
  // what deforms. Their normals are not used then, for they are those of the deformed surface,
  // unless `reference_normals` names a channel of others, "Nref". Empty: the position.
  std::string reference_positions{}, reference_normals{};
};

struct LookupStats {
  bool is_brick_map = false;
  std::vector<std::string> channels;  // that receivers got
  std::uint64_t points = 0;           // of a baked cloud, valid ones
  std::uint64_t skipped_points = 0;
  double spacing = 0;       // of these points, about
  double max_distance = 0;  // as given or found
  std::uint64_t receivers = 0;
  std::uint64_t invalid_receivers = 0;  // no position, or a normal that is none
  std::uint64_t missing_receivers = 0;  // valid, but without a value nearby
  std::uint64_t page_loads = 0;         // of a baked cloud, from its temporary file
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
  std::vector<std::pair<std::string, double>> phase_seconds;
};

// Writes `result`: the receivers of a cloud, passes (.exr) or a volume (.vdb), in their order with
// all their properties, and the values found in `map` as floats. A property that both have is
// replaced. `map` is a brick map (surfeit/brick.h) or a cloud with baked values in any format. Only
// values count whose surface faces as the receiver does: normals within 60 degrees for points, by
// direction for brick maps; places without a normal match any. A note tells how many receivers
// found nothing. The result depends only on map, receivers and the options that describe the
// look-up, bit for bit. Errors: kInvalidArgument (options; a channel that the map or the receivers
// lack), kCorruption, kBudgetTooSmall, kIoError, kInterrupted.
SURFEIT_API Result<LookupStats> lookupCloud(const std::string& map, const std::string& receivers,
                                            const std::string& result, const LookupOptions& options,
                                            Progress& progress);

// What lookupCloud takes, by some of the receivers, and of a baked cloud by some of the points.
// Records are receivers. Writes nothing but in a temporary folder. Errors: as lookupCloud.
SURFEIT_API Result<SampleForecast> forecastLookup(const std::string& map,
                                                  const std::string& receivers,
                                                  const std::string& result,
                                                  const LookupOptions& options, Progress& progress);

}  // namespace surfeit
