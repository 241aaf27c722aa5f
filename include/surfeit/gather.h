// Gathers at receivers from a paged octree file: ambient occlusion and color bleeding
// (memo 08-01, sections 3 and 7.5).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

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
  // sigma_max, steradians, >= 0; 0 opens every node (memo 5). Rough nodes keep below a
  // quarter of it.
  float max_solid_angle = 0.08f;
  int raster_resolution = 12;  // pixels along an edge of a cube face, even, 2..64 (memo 3.4)
  // Rays and horizon start this far above the receiver, in radii of the surfel looked at.
  float bias = 0.15f;
  // Surfels closer than this many of their radii are ray traced (memo 3.4.1).
  float near_field_radii = 8;
  // The far field is seen from the middle of 16 neighbouring receivers where that moves it by less
  // than this part of a raster pixel; 0: by every receiver for itself.
  float far_field_parallax = 0.3f;
  // Surfels farther than this do not count; scene units.
  float max_distance = 1e30f;
  GatherSides sides = GatherSides::kFront;
};

// Settings from measured tables (docs/benchmarks.md, "Errors and rates"). Standard is the default.
enum class QualityPreset : std::uint8_t { kDraft, kStandard, kFinal };

// Sets what decides about errors: max solid angle, raster resolution, near field, parallax. The rest,
// such as sides and distances, stays as it is.
void setQuality(QualityPreset preset, GatherQuality& quality);

// The order in which receivers are gathered. Decides how often pages are read, and which receivers
// share a packet and with it a cut: results of different orders differ as those of packets do from
// receivers gathered alone.
enum class ReceiverOrder : std::uint8_t {
  kHilbert,  // along the Hilbert curve of the scene
  kMorton,   // along its Morton (Z) curve, for comparison
  kInput,    // as they come: for clouds that are in a good order already
};

struct GatherOptions {
  GatherMode mode = GatherMode::kOcclusion;
  GatherQuality quality;
  // Budget of the process: its peak resident memory stays below this plus 64 MiB. 0: three quarters
  // of what the job may use.
  std::uint64_t memory_bytes = 0;
  int threads = 0;      // 0: all that the job may use
  bool strict = false;  // refuse invalid receivers instead of writing NaN for them

  ReceiverOrder order = ReceiverOrder::kHilbert;
  // Share of the cache memory that goes to node groups, 0..1; negative: found by measurement.
  double cache_split = -1;
  bool direct_io = false;  // read the scene past the page cache of the system
  bool prefetch = true;    // read ahead along the order of the receivers when reading is slow
  // Where receivers and results go that do not fit the memory; empty: beside the result.
  std::string temporary_directory;
};

// What one of the two caches did. Counts, bytes, and seconds summed over threads.
struct GatherCacheStats {
  std::uint64_t requests = 0;        // hits + misses
  std::uint64_t hits = 0;            // front_hits + shared_hits
  std::uint64_t front_hits = 0;      // answered by a thread's own front, or always resident
  std::uint64_t shared_hits = 0;     // found loaded, or being loaded by another thread
  std::uint64_t waits = 0;           // of the shared hits: those that waited for that other thread
  std::uint64_t misses = 0;          // loads that a thread waited for
  std::uint64_t prefetches = 0;      // loads ahead of any request
  std::uint64_t repeated_loads = 0;  // of both: of pages that had been evicted
  std::uint64_t evictions = 0;       // pages given up for others
  std::uint64_t bytes_read = 0, repeated_bytes = 0;  // stored bytes, of all and of repeated loads
  double load_seconds = 0;                           // reading, checking and decoding
  double stall_seconds = 0;                          // gathering threads waited for pages
  std::uint64_t peak_bytes = 0;                      // most bytes of frames in use
  std::uint64_t budget_bytes = 0;                    // frames this cache may fill
  std::uint64_t decoded_bytes = 0;                   // frames that would hold every page
  // Frames with which a tenth of the reads would repeat earlier ones, from sampled reuse distances.
  std::uint64_t working_set_bytes = 0;
};

// The monitor's record of a stretch of time. Counts are those of the window alone; peak_bytes and
// budget_bytes hold at its end. working_set_bytes is what the pages would fill that were looked up
// in the two seconds or so before, by samples; 0 at first (docs/stats.md).
struct GatherWindow {
  double begin_seconds = 0, end_seconds = 0;  // since the gather began
  std::uint64_t receivers = 0;
  std::uint64_t run_receivers = 0;       // neighbours that a thread takes at a time, at its end
  std::uint64_t prefetch_receivers = 0;  // how far ahead pages are read, at its end
  GatherCacheStats node_cache, surfel_cache;
};

struct GatherStats {
  std::uint64_t receivers = 0;
  std::uint64_t invalid_receivers = 0;
  double gather_seconds = 0;  // wall time inside the gather proper, without reading and writing
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // written to temporary files
  GatherCacheStats node_cache, surfel_cache;
  std::vector<GatherWindow> windows;  // in order; at most some hundreds, however long it took
};

// Gathers at every record of the cloud `receivers_path` (PLY) and writes `result_path` (PLY,
// binary): the receivers in their order, with all their properties, plus `occlusion` and with
// kBleeding `irradiance_r irradiance_g irradiance_b`. A receiver without a normal gathers over the
// whole sphere. The result depends on scene, receivers, order, mode, quality and the machine's
// instruction set alone, bit for bit; instruction sets agree within 1e-4.
// Errors: as indexClouds.
Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress);

}  // namespace surfeit
