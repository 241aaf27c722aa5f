// Gathers in caches of a few frames, whatever a plan would say, for tests of paging.
#pragma once

#include <initializer_list>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "batch/gather_crew.h"
#include "batch/gather_input.h"
#include "batch/sorted_receiver.h"
#include "io/fault_injector.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"

namespace surfeit {

struct FramesGather {
  std::string scene, receivers, temporary_directory;
  GatherOptions options;
  std::size_t frames = 1;  // of each cache
  int threads = 1, prefetch_threads = 0;
  FaultInjector* fault = nullptr;  // of the gather itself, not of opening and sorting
};

// Calls take(entry) for every result, one at a time.
template <typename Take>
Status gatherInFrames(const FramesGather& gather, GatherStats& stats, Take&& take) {
  Progress progress;
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(gather.scene));
  SURFEIT_ASSIGN_OR_RETURN(GatherInput input, GatherInput::open(gather.receivers));
  stats.receivers = input.receiverCount();
  stats.threads = gather.threads;
  ExternalSorter sorter({.record_bytes = sizeof(SortedReceiver),
                         .count = stats.receivers,
                         .memory_bytes = stats.receivers * sizeof(SortedReceiver),
                         .temporary_directory = gather.temporary_directory});
  SURFEIT_RETURN_IF_ERROR(
      input.sort(ReceiverOrder::kHilbert, scene.header(), true, sorter, progress));
  GatherMemory memory;
  memory.caches = {.node_frames = gather.frames,
                   .surfel_frames = gather.frames,
                   .least_node_frames = 1,
                   .least_surfel_frames = 1,
                   .front_slots = 1,
                   .tracked_pages = 64};
  memory.prefetch_threads = gather.prefetch_threads;
  std::mutex mutex;
  std::optional<Faults> faults;
  if (gather.fault != nullptr) faults.emplace(std::initializer_list<FaultInjector*>{gather.fault});
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<SortedGather> sorted,
      SortedGather::create(std::move(scene), memory, gather.options, stats, progress));
  SURFEIT_RETURN_IF_ERROR(sorted->gather(sorter, [&](std::span<const ResultStore::Entry> entries) {
    const std::lock_guard lock(mutex);
    for (const ResultStore::Entry& entry : entries) take(entry);
    return Status();
  }));
  sorted->finish();
  return {};
}

}  // namespace surfeit
