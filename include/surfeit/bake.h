// Gathers at all receivers of a cloud, from file to file, in a memory budget: ambient occlusion,
// color bleeding and reflections (memo 08-01, sections 3, 7.5 and 7.6).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/bounce_look.h"
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

// The order in which receivers are gathered. It decides how often pages are read, and which
// receivers share a packet. Results of two orders differ as little as the results of a packet and
// of a receiver gathered alone.
enum class ReceiverOrder : std::uint8_t {
  kHilbert,  // along the Hilbert curve of the scene
  kMorton,   // along its Morton (Z) curve, for comparison
  kInput,    // the order of the cloud, for clouds whose order is good already
};

// `memory_bytes`: 0 stands for three quarters of the memory that the job may use. Temporary files
// hold receivers and results that do not fit in memory; they stand beside the result unless
// `temporary_directory` says otherwise. `strict` refuses invalid receivers instead of writing NaN
// for them. ReadOptions are for the receivers; results keep the receivers' colors.
struct GatherOptions : GatherSettings, JobOptions, ReadOptions {
  GatherEnvironment environment;
  // Of the output irradiance alone: light from surfels, after the gather. Other outputs stay.
  BounceLook look;

  ReceiverOrder order = ReceiverOrder::kHilbert;
  // Part of the cache memory for node groups, 0..1; negative: found by measurement.
  double cache_split = -1;
  bool direct_io = false;  // read the scene past the page cache of the system
  bool prefetch = true;    // read ahead along the order of the receivers when reading is slow
  // A directory of this machine for pages of the scene, as they are read: gathers that come later,
  // and others at the same time, read them there (docs/farm.md, "Scratch on the node"). Copies
  // stay until someone removes them. Empty: none. Limit in bytes of all copies there, about; 0: a
  // tenth of the disk stays free.
  std::string stage_directory{};
  std::uint64_t stage_limit_bytes = 0;
};

struct GatherStats {
  std::uint32_t outputs = 0;  // what receivers got, set of GatherOutput
  std::uint64_t receivers = 0;
  std::uint64_t invalid_receivers = 0;
  std::uint64_t interpolated_receivers = 0;  // all other valid receivers were gathered
  double gather_seconds = 0;  // wall time inside the gather proper, without reading and writing
  int threads = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;                           // written to temporary files
  std::uint64_t staged_bytes_read = 0, staged_bytes_kept = 0;  // of pages, in the stage
  GatherCacheStats node_cache, surfel_cache;
  std::vector<GatherWindow> windows;  // in order; at most some hundreds, for any running time
};

// Gathers at every record of the cloud `receivers_path` and writes `result_path`; its name tells
// the format (docs/files.md). The result has the receivers in their order, with all their
// properties, plus the outputs: by default `occlusion`, and with kBleeding `irradiance_r
// irradiance_g irradiance_b`. A receiver without a normal gathers over the whole sphere. The result
// depends only on the scene, the receivers, the settings, the order and the machine's instruction
// set, bit for bit. Instruction sets agree within 1e-4, except for two of 1000 receivers, which
// agree within 3e-3.
// Errors: as indexClouds.
SURFEIT_API Result<GatherStats> gatherCloud(const std::string& scene_path,
                                            const std::string& receivers_path,
                                            const std::string& result_path,
                                            const GatherOptions& options, Progress& progress);

}  // namespace surfeit
