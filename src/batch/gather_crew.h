// Gathers at sorted receivers on a fixed number of threads. Each takes the next run of
// neighbours along the curve, so that all of them work in one neighbourhood and what one reads the
// others find in the caches.
#pragma once

#include <atomic>
#include <functional>
#include <span>

#include "batch/gather_memory.h"
#include "batch/paging_controller.h"
#include "batch/prefetcher.h"
#include "batch/receiver_queue.h"
#include "batch/result_store.h"
#include "core/first_failure.h"
#include "gather/light/environment_map.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

class GatherCrew {
 public:
  // What takes the results of a run, from any thread.
  using Sink = std::function<Status(std::span<const ResultStore::Entry>)>;

  // All that is referred to must outlive the crew.
  struct Setup {
    PagedOctree& octree;
    ReceiverQueue& queue;
    PagingController& controller;
    GatherRules rules;
    int threads = 1;
    int prefetch_threads = 0;
    Progress& progress;
  };
  GatherCrew(const Setup& setup, Sink sink);

  // Gathers until the queue is empty, and advances progress and controller. Returns the first
  // failure, kInterrupted when the progress is cancelled. Once.
  Status run();

  // Receivers of these that were interpolated. After run().
  std::uint64_t interpolatedCount() const { return interpolated_count_; }

 private:
  Status gatherRuns();

  const Setup setup_;
  const Sink sink_;
  Prefetcher prefetcher_;
  FirstFailure failure_;
  std::atomic<std::uint64_t> interpolated_count_{0};
};

// The gather proper: opens the caches of `scene`, gathers at what is in `sorter` (finished), and
// fills in the statistics of that; threads of `stats` work, as many prefetch as `memory` says.
Status gatherSorted(SceneFile scene, ExternalSorter& sorter, const GatherMemory& memory,
                    const GatherOptions& options, GatherStats& stats, GatherCrew::Sink sink,
                    Progress& progress, const LoadedEnvironment* environment = nullptr);

}  // namespace surfeit
