// Gathers at sorted receivers on a fixed number of threads. Each takes the next run of
// neighbours along the curve, so that all of them work in one neighbourhood and what one reads the
// others find in the caches.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <span>
#include <utility>

#include "batch/gather_memory.h"
#include "batch/paging_controller.h"
#include "batch/prefetcher.h"
#include "batch/receiver_queue.h"
#include "batch/result_store.h"
#include "core/first_failure.h"
#include "engine/planned_scene.h"
#include "engine/world.h"
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
    const std::shared_ptr<const World> world;
    ReceiverQueue& queue;
    PagingController& controller;
    const BounceLook* look = nullptr;  // of the irradiance, about the scene's origin
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
  void applyLook(std::span<const LocalReceiver> receivers, std::span<GatherResult> results) const;

  const Setup setup_;
  const Sink sink_;
  Prefetcher prefetcher_;
  FirstFailure failure_;
  std::atomic<std::uint64_t> interpolated_count_{0};
};

// The gather proper: a scene in planned caches, and a crew for each piece of the order. `threads`
// of the statistics work, as many prefetch as the memory says. It is the phase "gather" of the
// progress, in which the receivers that are not valid are done at once. One thread at a time.
class SortedGather {
 public:
  // Opens the caches; `stats` has threads, memory and numbers of receivers. All that is referred to
  // must outlive this.
  static Result<std::unique_ptr<SortedGather>> create(
      SceneFile scene, const GatherMemory& memory, const GatherOptions& options, GatherStats& stats,
      Progress& progress, const LoadedEnvironment* environment = nullptr);
  // In caches that are open; `is_warm`: that an earlier gather has used.
  static std::unique_ptr<SortedGather> create(std::unique_ptr<PagedOctree> octree, bool is_warm,
                                              const GatherMemory& memory,
                                              const GatherOptions& options, GatherStats& stats,
                                              Progress& progress,
                                              const LoadedEnvironment* environment);

  // Gathers at the next `count` receivers of the sorter (finished): whole groups, unless none come
  // after them.
  Status gather(ExternalSorter& sorter, GatherCrew::Sink sink,
                std::uint64_t count = ReceiverQueue::kAll);
  // Fills in the statistics, and tells what happened to the stage.
  void finish();
  // The octree, for another gather. The last call.
  std::unique_ptr<PagedOctree> takeOctree();

 private:
  SortedGather(std::unique_ptr<PagedOctree> octree, bool is_warm, const GatherMemory& memory,
               const GatherOptions& options, GatherStats& stats, Progress& progress,
               const LoadedEnvironment* environment);

  const std::shared_ptr<SceneState> scene_;
  std::shared_ptr<const World> world_;
  const std::uint64_t staged_read_, staged_kept_;  // before
  const int prefetch_threads_;
  const BounceLook look_;
  GatherStats& stats_;
  Progress& progress_;
  PagingController controller_;
};

}  // namespace surfeit
