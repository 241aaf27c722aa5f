#include "tune/sampled_gather.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_memory.h"
#include "batch/receiver_queue.h"
#include "core/seconds_since.h"

namespace surfeit {

Result<std::unique_ptr<SampledGather>> SampledGather::create(SceneFile scene,
                                                             const PagedOctree::Memory& memory,
                                                             const GatherOptions& options,
                                                             int threads, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(scene), memory));
  return std::unique_ptr<SampledGather>(
      new SampledGather(std::move(octree), options, threads, progress));
}

SampledGather::SampledGather(std::unique_ptr<PagedOctree> octree, const GatherOptions& options,
                             int threads, Progress& progress)
    : octree_(std::move(octree)),
      options_(options),
      threads_(threads),
      progress_(progress),
      controller_(*octree_, {.threads = threads, .adapts_split = false, .prefetches = false},
                  progress_) {}

Result<double> SampledGather::gather(std::span<const SortedReceiver> receivers) {
  // They are few enough to stay in memory
  const std::uint64_t bytes =
      std::max(receivers.size_bytes(),
               ExternalSorter::leastMemoryBytes(receivers.size(), sizeof(SortedReceiver)));
  ExternalSorter sorter({.record_bytes = sizeof(SortedReceiver),
                         .count = receivers.size(),
                         .memory_bytes = bytes,
                         .temporary_directory = {}});
  for (const SortedReceiver& receiver : receivers) SURFEIT_RETURN_IF_ERROR(sorter.add(receiver));
  SURFEIT_RETURN_IF_ERROR(sorter.finish());

  const auto begin = std::chrono::steady_clock::now();
  ReceiverQueue queue(sorter, kQueueReceivers);
  GatherCrew crew({.octree = *octree_,
                   .queue = queue,
                   .controller = controller_,
                   .rules = GatherRules(options_),
                   .threads = threads_,
                   .progress = progress_},
                  [](std::span<const ResultStore::Entry>) { return Status(); });
  SURFEIT_RETURN_IF_ERROR(crew.run());
  return secondsSince(begin);
}

}  // namespace surfeit
