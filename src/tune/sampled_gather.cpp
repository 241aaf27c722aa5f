#include "tune/sampled_gather.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_memory.h"
#include "batch/receiver_queue.h"
#include "core/seconds_since.h"
#include "engine/planned_scene.h"

namespace surfeit {

Result<std::unique_ptr<SampledGather>> SampledGather::create(SceneFile scene,
                                                             const PagedOctree::Memory& memory,
                                                             const GatherOptions& options,
                                                             int threads, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<SceneState> opened,
                           openPlanned(std::move(scene), memory, monitoring(memory, false)));
  return std::unique_ptr<SampledGather>(new SampledGather(
      World::ofPlanned(std::move(opened), GatherRules(options)), threads, progress));
}

SampledGather::SampledGather(std::shared_ptr<const World> world, int threads, Progress& progress)
    : world_(std::move(world)),
      threads_(threads),
      progress_(progress),
      controller_(*world_, {.threads = threads, .prefetches = false}, progress_) {}

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
  GatherCrew crew({.world = world_,
                   .queue = queue,
                   .controller = controller_,
                   .threads = threads_,
                   .progress = progress_},
                  [](std::span<const ResultStore::Entry>) { return Status(); });
  SURFEIT_RETURN_IF_ERROR(crew.run());
  return secondsSince(begin);
}

}  // namespace surfeit
