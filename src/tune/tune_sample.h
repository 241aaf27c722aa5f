// The sampled run of a tuning: what a gather at all receivers would look up and take, found out
// from some of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "batch/gather_memory.h"
#include "batch/sorted_receiver.h"
#include "cache/miss_ratio_curve.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// What one of the two caches would see in a gather at all receivers.
struct CacheSample {
  MissRatioCurve curve;     // of all look-ups
  double load_seconds = 0;  // of one page, in the mean
  double page_bytes = 0;    // stored bytes of a page, in the mean
};

struct TuneSample {
  std::uint64_t receivers = 0;  // whose look-ups were followed
  CacheSample nodes, surfels;
  double receiver_seconds = 0;  // wall time by all threads together, with all pages in memory
  double seconds = 0;           // wall time of the sampled run
};

// Memory of a sampled run beside that of a gather.
std::uint64_t tuneSampleBytes(const SceneFile& file, std::uint64_t sample_receivers, int threads);

// Follows the look-ups of about sample_receivers of the `receivers` that the sorter (finished)
// holds, and gathers at some of them, in the caches of `memory`. With 0, or no less than there are,
// all are followed, and the curves are those of all.
Result<TuneSample> sampleGather(const std::string& scene_path, ExternalSorter& sorter,
                                std::uint64_t receivers, std::uint64_t sample_receivers,
                                const PagedOctree::Memory& memory, const GatherOptions& options,
                                int threads, Progress& progress);

}  // namespace surfeit
