#include "batch/gather_crew.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "batch/bounce_look.h"
#include "core/seconds_since.h"
#include "core/worker_threads.h"
#include "engine/thread_gatherer.h"

namespace surfeit {
namespace {

// Null unless pages are kept on this node, too.
PageStage* stageOf(const World& world) { return world.file().pages().stage().get(); }

}  // namespace

GatherCrew::GatherCrew(const Setup& setup, Sink sink)
    : setup_(setup),
      sink_(std::move(sink)),
      prefetcher_(*setup_.world, setup_.queue, setup_.controller, setup_.prefetch_threads) {}

Status GatherCrew::run() {
  return runOnThreads(setup_.threads, failure_, "gather", [this] { return gatherRuns(); });
}

// Takes runs until none is left or some thread has failed. Runs are whole groups, so that what is
// gathered together is a matter of the order alone.
Status GatherCrew::gatherRuns() {
  ThreadGatherer gatherer(setup_.world);
  const std::size_t group_size = gatherer.size();
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
      SURFEIT_RETURN_IF_ERROR(
          gatherer.gather(std::span(group).first(count), std::span(group_results).first(count)));
      applyLook(group, std::span(group_results).first(count));
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

void GatherCrew::applyLook(std::span<const LocalReceiver> receivers,
                           std::span<GatherResult> results) const {
  if (setup_.look == nullptr || setup_.look->isOff()) return;
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i].irradiance = lookedAt(*setup_.look, results[i].irradiance, receivers[i].position,
                                     receivers[i].normal, false);
  }
}

Result<std::unique_ptr<SortedGather>> SortedGather::create(SceneFile scene,
                                                           const GatherMemory& memory,
                                                           const GatherOptions& options,
                                                           GatherStats& stats, Progress& progress,
                                                           const LoadedEnvironment* environment) {
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory.caches));
  return create(std::move(octree), false, memory, options, stats, progress, environment);
}

std::unique_ptr<SortedGather> SortedGather::create(std::unique_ptr<PagedOctree> octree,
                                                   bool is_warm, const GatherMemory& memory,
                                                   const GatherOptions& options, GatherStats& stats,
                                                   Progress& progress,
                                                   const LoadedEnvironment* environment) {
  return std::unique_ptr<SortedGather>(
      new SortedGather(std::move(octree), is_warm, memory, options, stats, progress, environment));
}

SortedGather::SortedGather(std::unique_ptr<PagedOctree> octree, bool is_warm,
                           const GatherMemory& memory, const GatherOptions& options,
                           GatherStats& stats, Progress& progress,
                           const LoadedEnvironment* environment)
    : scene_(plannedScene(std::move(octree),
                          monitoring(memory.caches, options.cache_split < 0, is_warm))),
      world_(World::ofPlanned(scene_, gatherRules(options, environment))),
      staged_read_(is_warm && stageOf(*world_) ? stageOf(*world_)->bytesRead() : 0),
      staged_kept_(is_warm && stageOf(*world_) ? stageOf(*world_)->bytesKept() : 0),
      prefetch_threads_(memory.prefetch_threads),
      look_(options.look),
      stats_(stats),
      progress_(progress),
      controller_(*world_,
                  {.threads = stats.threads,
                   .prefetches = memory.prefetch_threads != 0,
                   .is_warm = is_warm,
                   .memory_bytes = stats.memory_bytes,
                   .work = memory.work,
                   .receivers = stats.receivers - stats.invalid_receivers},
                  progress) {
  progress.beginPhase("gather", stats.receivers, "receivers");
  progress.advance(stats.invalid_receivers);
}

Status SortedGather::gather(ExternalSorter& sorter, GatherCrew::Sink sink, std::uint64_t count) {
  const auto begin = std::chrono::steady_clock::now();
  ReceiverQueue queue(sorter, kQueueReceivers, count);
  GatherCrew crew({.world = world_,
                   .queue = queue,
                   .controller = controller_,
                   .look = &look_,
                   .threads = stats_.threads,
                   .prefetch_threads = prefetch_threads_,
                   .progress = progress_},
                  std::move(sink));
  SURFEIT_RETURN_IF_ERROR(crew.run());
  stats_.interpolated_receivers += crew.interpolatedCount();
  stats_.gather_seconds += secondsSince(begin);
  return {};
}

// The readers of all crews are gone, so that their last counts have reached the caches.
void SortedGather::finish() {
  controller_.finish();
  const CacheMonitor& monitor = world_->engine().monitor;
  stats_.node_cache = monitor.nodeStats();
  stats_.surfel_cache = monitor.surfelStats();
  stats_.windows = monitor.windows();
  PageStage* const stage = stageOf(*world_);
  if (stage == nullptr) return;
  stats_.staged_bytes_read = stage->bytesRead() - staged_read_;
  stats_.staged_bytes_kept = stage->bytesKept() - staged_kept_;
  for (const std::string& note : stage->takeNotes()) progress_.inform(note);
}

std::unique_ptr<PagedOctree> SortedGather::takeOctree() {
  world_.reset();
  return std::move(scene_->octree);
}

}  // namespace surfeit
