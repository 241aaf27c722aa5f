#include "batch/gather_crew.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "core/seconds_since.h"
#include "core/worker_threads.h"
#include "gather/packet/group_gatherer.h"

namespace surfeit {

GatherCrew::GatherCrew(const Setup& setup, Sink sink)
    : setup_(setup),
      sink_(std::move(sink)),
      prefetcher_(setup_.octree, setup_.queue, setup_.controller, setup_.rules,
                  setup_.prefetch_threads) {}

Status GatherCrew::run() {
  return runOnThreads(setup_.threads, failure_, "gather", [this] { return gatherRuns(); });
}

// Takes runs until none is left or some thread has failed. Runs are whole groups, so that what is
// gathered together is a matter of the order alone.
Status GatherCrew::gatherRuns() {
  GroupGatherer gatherer(setup_.rules);
  const std::size_t group_size = gatherer.size();
  PagedOctree::Reader reader(setup_.octree);
  WorldReader world(reader);
  std::vector<SortedReceiver> run;
  std::vector<ResultStore::Entry> results;
  std::vector<LocalReceiver> group(group_size);
  std::vector<GatherResult> group_results(group_size);
  const std::size_t most_run = std::max<std::size_t>(PagingController::kMostRun, group_size);
  run.reserve(most_run);
  results.reserve(most_run);
  while (!failure_.happened()) {
    const std::size_t run_size =
        std::max<std::size_t>(setup_.controller.runReceivers(), group_size);
    SURFEIT_RETURN_IF_ERROR(setup_.queue.take(run, run_size));
    if (run.empty()) break;
    prefetcher_.notify();
    results.clear();
    for (std::size_t begin = 0; begin < run.size(); begin += group_size) {
      if (setup_.progress.isCancelled()) return Status::interrupted();
      const std::size_t count = std::min(group_size, run.size() - begin);
      for (std::size_t i = 0; i < count; ++i) group[i] = run[begin + i].receiver;
      SURFEIT_RETURN_IF_ERROR(gatherer.gather(std::span(group).first(count), world,
                                              std::span(group_results).first(count)));
      for (std::size_t i = 0; i < count; ++i) {
        results.push_back({run[begin + i].index, group_results[i]});
      }
    }
    SURFEIT_RETURN_IF_ERROR(sink_(results));
    setup_.progress.advance(run.size());
    setup_.controller.advance(run.size());
  }
  interpolated_count_ += gatherer.interpolatedCount();
  return {};
}

Status gatherSorted(SceneFile scene, ExternalSorter& sorter, const GatherMemory& memory,
                    const GatherOptions& options, GatherStats& stats, GatherCrew::Sink sink,
                    Progress& progress, const LoadedEnvironment* environment) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory.caches));
  progress.beginPhase("gather", stats.receivers, "receivers");
  progress.advance(stats.invalid_receivers);
  const auto begin = std::chrono::steady_clock::now();
  const bool adapts_split = options.cache_split < 0;
  PagingController controller(*octree,
                              {.threads = stats.threads,
                               .adapts_split = adapts_split,
                               .prefetches = memory.prefetch_threads != 0,
                               .memory_bytes = stats.memory_bytes,
                               .work = memory.work,
                               .receivers = stats.receivers - stats.invalid_receivers,
                               .least_node_frames = memory.caches.least_node_frames,
                               .least_surfel_frames = memory.caches.least_surfel_frames},
                              progress);
  ReceiverQueue queue(sorter, kQueueReceivers);
  {
    GatherCrew crew({.octree = *octree,
                     .queue = queue,
                     .controller = controller,
                     .rules = gatherRules(options, environment),
                     .threads = stats.threads,
                     .prefetch_threads = memory.prefetch_threads,
                     .progress = progress},
                    std::move(sink));
    SURFEIT_RETURN_IF_ERROR(crew.run());
    stats.interpolated_receivers = crew.interpolatedCount();
  }  // the readers go, and with them their last counts reach the caches
  controller.finish();
  stats.gather_seconds = secondsSince(begin);
  stats.node_cache = controller.nodeStats();
  stats.surfel_cache = controller.surfelStats();
  stats.windows = controller.windows();
  return {};
}

}  // namespace surfeit
