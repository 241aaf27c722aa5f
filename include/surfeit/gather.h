// Gathers at receivers from a paged octree file: ambient occlusion and color bleeding
// (memo 08-01, sections 3 and 7.5).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/color_range.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// What is gathered, by which weights of directions.
enum class GatherMode : std::uint8_t {
  kOcclusion,  // over the hemisphere above the receiver; coverage alone (memo 7.5)
  kBleeding,   // the same with light (memo 3)
  kGlossy,     // over a lobe around the direction of mirror reflection (memo 7.6)
};

// What receivers get, any set of it in one pass. Light is in units of radiosity: E = pi * mean
// radiance by the weights of the mode, so that inside a closed shell of radiosity B it is B.
enum GatherOutput : std::uint32_t {
  kOutputOcclusion = 1u << 0,   // covered part, 0..1
  kOutputIrradiance = 1u << 1,  // light from surfels: irradiance; with kGlossy the reflection
  kOutputBentNormal = 1u << 2,  // mean direction of what is open, unit; 0 when nothing is (slides)
  // Mean direction that light comes from, weighted by luminance, unit; 0 without light (slides)
  kOutputIlluminationDirection = 1u << 3,
  kOutputEnvironment = 1u << 4,  // light of the environment map where nothing covers (memo 7.3)
  // For volumes: 4 pi * mean radiance over the sphere, of surfels and environment; the hemisphere
  // of a receiver with a normal counts twice
  kOutputFluence = 1u << 5,
  // 9 spherical harmonics coefficients per color of pi times the incident radiance, of surfels and
  // environment, over what the receiver sees: the sphere, or the hemisphere
  kOutputRadianceSh = 1u << 6,
};

// How directions weigh, and what is found there (app note 2.3). To a receiver without a normal all
// directions weigh alike.
struct GatherWeights {
  enum class Distribution : std::uint8_t { kCosine, kUniform };
  enum class FalloffMode : std::uint8_t { kExponential, kPolynomial };

  Distribution distribution = Distribution::kCosine;  // not with kGlossy
  // Half the opening angle of the cone around the normal, or around the reflection with kGlossy,
  // outside of which directions have no weight; radians, to pi / 2. 0: the hemisphere, and with
  // kGlossy to where the lobe falls to a hundredth.
  float cone_angle = 0;
  // With kGlossy: within the cone, directions weigh like cos^n of the angle to the reflection with
  // n = 2 / roughness^2 - 2; 1: all alike. Over 0 to 1.
  float roughness = 0.1f;
  // How occlusion fades with distance: exp(-falloff * distance), or (1 - distance / max_distance)
  // ^ falloff, which needs a max distance. 0: not at all. Light does not fade.
  float falloff = 0;
  FalloffMode falloff_mode = FalloffMode::kExponential;
};

// Light from all around, infinitely far away (memo 7.3).
struct GatherEnvironment {
  std::string path;  // lat-long picture in OpenEXR or Radiance (.hdr), or OpenEXR cube; empty: none
  float rotation = 0;          // about the up axis, radians, counterclockwise seen from above
  std::optional<UpAxis> up{};  // absent: the scene's
  float intensity = 1;         // multiplies it, >= 0
};

// Which side of a one-sided surfel covers the raster. Only front sides send light; with kBack
// nothing does.
enum class GatherSides : std::uint8_t { kFront, kBoth, kBack };

// How the gather approximates. Scene units are the cloud's own.
struct GatherQuality {
  // sigma_max, steradians, >= 0; 0 opens every node (memo 5). Nodes that are not flat
  // keep below 2/3 of it.
  float max_solid_angle = 0.1f;
  int raster_resolution = 16;  // pixels along an edge of a cube face, even, 2..64 (memo 3.4)
  // Rays and horizon start this far above the receiver, in radii of the surfel looked at, or where
  // its longer side is known (two-sided surfels only) in widths.
  float bias = 0.15f;
  // Surfels closer than this many of their radii are ray traced (memo 3.4.1), or of eighths of
  // their longer side.
  float near_field_radii = 8;
  // Surfels farther than this do not count; scene units.
  float max_distance = 1e30f;
  GatherSides sides = GatherSides::kFront;
  // Where results vary less than this from receiver to receiver, only some are gathered and the
  // others interpolated between them: occlusion may differ by this, lights by this part of the
  // brightest nearby, directions by this part of a turn to the opposite (app note 2.2). 0: off.
  float max_variation = 0;
};

// Settings from measured tables (docs/benchmarks.md, "Errors and rates"). Standard is the default.
enum class QualityPreset : std::uint8_t { kDraft, kStandard, kFinal };

// Sets what decides about errors: max solid angle, raster resolution, near field. The rest, such as
// sides and distances, stays as it is.
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
  std::uint32_t outputs = 0;  // set of GatherOutput; 0: occlusion, and light unless kOcclusion
  GatherQuality quality;
  GatherWeights weights;
  GatherEnvironment environment;
  // Set of the groups of surfels that send light and cover, as bits (surfeit/surfel.h); others are
  // as if they were not there. At least one must be in the scene; kAllGroups is right for any.
  std::uint64_t groups = kAllGroups;
  // With kGlossy, receivers without view_x view_y view_z are looked at from here; NaN: all need
  // theirs.
  glm::dvec3 eye{std::numeric_limits<double>::quiet_NaN()};
  // Budget of the job. What the process holds besides, code, libraries and what the caller has, is
  // not counted (the program counts it). 0: three quarters of what the job may use.
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

  // Channels of the receivers to be called otherwise, "FROM=TO,FROM=TO" (docs/files.md), and of
  // files with several parts (grids, layers, elements) the one to read; empty: the first with a
  // cloud.
  std::string channels, part;
  // Which records are read, "classification == 2" (docs/files.md, "Filters"); empty: all but those
  // that the format marks as not to be used.
  std::string filter;
  // How colors of the receivers, which results keep, are read whose numbers do not say what they
  // mean.
  ColorRange color_range = ColorRange::kAuto;
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
  std::uint64_t interpolated_receivers = 0;  // the rest of the valid ones was gathered
  double gather_seconds = 0;  // wall time inside the gather proper, without reading and writing
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;  // written to temporary files
  GatherCacheStats node_cache, surfel_cache;
  std::vector<GatherWindow> windows;  // in order; at most some hundreds, however long it took
};

// Gathers at every record of the cloud `receivers_path` and writes `result_path`, of the format
// that its name tells (docs/files.md): the receivers in their order, with all their properties,
// plus `occlusion` and with kBleeding `irradiance_r irradiance_g irradiance_b`. A receiver without
// a normal gathers over the whole sphere. The result depends on scene, receivers, order, mode,
// quality and the machine's instruction set alone, bit for bit; instruction sets agree within 1e-4,
// and for two of 1000 receivers within 3e-3.
// Errors: as indexClouds.
Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress);

}  // namespace surfeit
