// Gathers at all records of a cloud, from file to file, in a memory budget: ambient occlusion and
// color bleeding (memo 08-01, sections 3 and 7.5).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/gather.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/statistics.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

struct GatherEnvironment : EnvironmentPlacement {
  // Lat-long picture in OpenEXR or Radiance (.hdr), or OpenEXR cube; empty: none.
  std::string path;
};

// The order in which receivers are gathered. Decides how often pages are read, and which receivers
// share a packet and with it a cut: results of different orders differ as those of packets do from
// receivers gathered alone.
enum class ReceiverOrder : std::uint8_t {
  kHilbert,  // along the Hilbert curve of the scene
  kMorton,   // along its Morton (Z) curve, for comparison
  kInput,    // as they come: for clouds that are in a good order already
};

// `memory_bytes` 0 stands for three quarters of what the job may use; temporary files hold
// receivers and results that do not fit the memory, beside the result unless told otherwise;
// `strict` refuses invalid receivers instead of writing NaN for them. What is read are the
// receivers, whose colors results keep.
struct GatherOptions : GatherSettings, JobOptions, ReadOptions {
  GatherEnvironment environment;

  ReceiverOrder order = ReceiverOrder::kHilbert;
  // Share of the cache memory that goes to node groups, 0..1; negative: found by measurement.
  double cache_split = -1;
  bool direct_io = false;  // read the scene past the page cache of the system
  bool prefetch = true;    // read ahead along the order of the receivers when reading is slow
};

struct GatherStats {
  std::uint32_t outputs = 0;  // what receivers got, set of GatherOutput
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
SURFEIT_API Result<GatherStats> gatherCloud(const std::string& scene_path,
                                            const std::string& receivers_path,
                                            const std::string& result_path,
                                            const GatherOptions& options, Progress& progress);

}  // namespace surfeit
