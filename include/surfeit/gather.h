// Gathers at receivers from a paged octree file: ambient occlusion and color bleeding
// (memo 08-01, sections 3 and 7.5).
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

enum class GatherMode : std::uint8_t {
  kOcclusion,  // cosine-weighted coverage of the hemisphere, 0..1
  kBleeding,   // occlusion, and irradiance from the radiosity of the surfels
};

// Which side of a one-sided surfel covers the raster. Only front sides send light.
enum class GatherSides : std::uint8_t { kFront, kBoth };

// How the gather approximates. Scene units are the cloud's own.
struct GatherQuality {
  float max_solid_angle = 0.05f;  // sigma_max, steradians, >= 0; 0 opens every node (memo 5)
  int raster_resolution = 12;     // pixels along an edge of a cube face, even, 2..64 (memo 3.4)
  // Rays and horizon start this far above the receiver, in radii of the surfel looked at.
  float bias = 0.15f;
  // Surfels closer than this many of their radii are ray traced (memo 3.4.1).
  float near_field_radii = 8;
  // Surfels farther than this do not count; scene units.
  float max_distance = 1e30f;
  GatherSides sides = GatherSides::kFront;
};

struct GatherOptions {
  GatherMode mode = GatherMode::kOcclusion;
  GatherQuality quality;
  std::uint64_t memory_bytes =
      0;                // budget of the process; 0: three quarters of what the job may use
  int threads = 0;      // 0: all that the job may use
  bool strict = false;  // refuse invalid receivers instead of writing NaN for them
};

struct GatherCacheStats {
  std::uint64_t requests = 0, hits = 0, misses = 0, evictions = 0, bytes_read = 0, peak_bytes = 0;
  std::uint64_t budget_bytes = 0;   // frames this cache may fill
  std::uint64_t decoded_bytes = 0;  // frames that would hold every page
};

struct GatherStats {
  std::uint64_t receivers = 0;
  std::uint64_t invalid_receivers = 0;
  double gather_seconds = 0;  // wall time inside the gather proper, without reading and writing
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  GatherCacheStats node_cache, surfel_cache;
};

// Gathers at every record of the cloud `receivers_path` (PLY) and writes `result_path` (PLY,
// binary): the receivers in their order, with all their properties, plus `occlusion` and with
// kBleeding `irradiance_r irradiance_g irradiance_b`. A receiver without a normal gathers over the
// whole sphere. The result depends on scene, receivers, mode and quality alone, bit for bit.
// Errors: as indexClouds.
Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress);

}  // namespace surfeit
