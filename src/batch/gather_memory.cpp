#include "batch/gather_memory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "batch/gather_options.h"
#include "batch/paging_controller.h"
#include "batch/prefetcher.h"
#include "batch/receiver_rows.h"
#include "batch/result_store.h"
#include "batch/sorted_receiver.h"
#include "cache/reuse_distances.h"
#include "core/program_memory.h"
#include "engine/gatherer_memory.h"
#include "gather/packet/group_gatherer.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

// Buffers of the PLY reader (0.3 MiB) and writer (1.1 MiB).
constexpr std::uint64_t kStreamBytes = std::uint64_t{3} << 19;
// Stack and allocator of a thread.
constexpr std::uint64_t kThreadBytes = std::uint64_t{128} << 10;
// Pages that are sampled for the reuse distances of each cache.
constexpr std::size_t kTrackedPages = 8192;
// Receivers and results take no more than this part of the budget, unless they must.
constexpr std::uint64_t kReceiverPart = 4;
// And threads that prefetch no more than this.
constexpr std::uint64_t kPrefetchPart = 16;
// Runs longer than this make merging no faster.
constexpr std::uint64_t kMostSorterBytes = std::uint64_t{1} << 30;
constexpr std::uint64_t kMostReadingBytes = std::uint64_t{32} << 20;

// Bytes of a thread beside its part of the caches.
std::uint64_t threadBytes(const SceneFile& file, const GatherWork& work) {
  const std::size_t group_size = GroupGatherer::groupSize(work.rules);
  const std::size_t most_run = std::max<std::size_t>(PagingController::kMostRun, group_size);
  return gathererBytes(work.rules, file.header().surfel_count) +
         most_run * (sizeof(SortedReceiver) + sizeof(ResultStore::Entry)) +
         group_size * (sizeof(LocalReceiver) + sizeof(GatherResult));
}

// All but receivers, results and caches.
std::uint64_t fixedBytes(const SceneFile& file, const GatherWork& work, int prefetch_threads) {
  const auto threads = static_cast<std::uint64_t>(work.threads);
  const std::uint64_t rows = kSliceRows * (work.input_row_bytes + work.result_row_bytes);
  return programBytes(work.threads + prefetch_threads) + work.held_bytes +
         PagedOctree::fixedBytes(file, work.threads + prefetch_threads) +
         threads * threadBytes(file, work) +
         static_cast<std::uint64_t>(prefetch_threads) * (kThreadBytes + sizeof(CutWalk)) + rows +
         (file.pages().stage() != nullptr ? PageStage::kMemoryBytes : 0) + kStreamBytes +
         kQueueReceivers * sizeof(SortedReceiver) + PagingController::memoryBytes() +
         ReuseDistances::memoryBytes(file.nodePageCount(), kTrackedPages) +
         ReuseDistances::memoryBytes(file.surfelPageCount(), kTrackedPages);
}

std::uint64_t resultBytes(const GatherWork& work) {
  return resultFloats(work.rules.outputs) * sizeof(float);
}

std::uint64_t leastReceiverBytes(const GatherWork& work) {
  const std::uint64_t all = work.receivers * (sizeof(SortedReceiver) + resultBytes(work));
  return std::min(
      all, ExternalSorter::leastMemoryBytes(work.receivers, sizeof(SortedReceiver)) +
               ResultStore::leastMemoryBytes(work.receivers, resultFloats(work.rules.outputs)));
}

std::uint64_t leastBytes(const SceneFile& file, const GatherWork& work, int prefetch_threads) {
  return fixedBytes(file, work, prefetch_threads) + leastReceiverBytes(work) +
         PagedOctree::leastCacheBytes(file, work.threads + prefetch_threads);
}

// Divides `bytes` among receivers and results; `spare_bytes` are free until the gather begins.
void planReceivers(const GatherWork& work, std::uint64_t bytes, std::uint64_t spare_bytes,
                   GatherMemory& memory) {
  const std::uint64_t receivers = work.receivers;
  const std::uint64_t all_receivers = receivers * sizeof(SortedReceiver);
  const std::uint64_t all_results = receivers * resultBytes(work);
  if (all_receivers + all_results <= bytes) {
    memory.sorter_bytes = memory.sorter_reading_bytes = all_receivers;
    memory.result_bytes = all_results;
    return;
  }
  const std::uint64_t least_sorter =
      ExternalSorter::leastMemoryBytes(receivers, sizeof(SortedReceiver));
  const std::uint64_t least_results =
      ResultStore::leastMemoryBytes(receivers, resultFloats(work.rules.outputs));
  memory.sorter_reading_bytes =
      std::clamp(bytes / 4, least_sorter, std::max(least_sorter, kMostReadingBytes));
  memory.result_bytes = std::min(
      all_results, std::max(least_results, bytes - std::min(bytes, memory.sorter_reading_bytes)));
  memory.sorter_bytes = std::clamp(spare_bytes, memory.sorter_reading_bytes,
                                   std::max(memory.sorter_reading_bytes, kMostSorterBytes));
}

}  // namespace

GatherWork gatherWork(const RowLayout& receivers, const GatherOptions& options) {
  const GatherRules rules(options);
  return {.receivers = receivers.count,
          .input_row_bytes = receivers.row_bytes,
          .result_row_bytes = ResultRows(receivers, rules.outputs, rules.mode).rowBytes(),
          .rules = rules,
          .threads = options.threads,
          .prefetch_threads = options.prefetch ? Prefetcher::kThreads : 0,
          .cache_split = options.cache_split};
}

std::string formatMebibytes(std::uint64_t bytes) {
  return fmt::format("{:.1f} MiB", std::ceil(double(bytes) / (1 << 20) * 10) / 10);
}

Status refuseBudget(std::uint64_t memory_bytes, const std::string& work,
                    std::uint64_t least_bytes) {
  return Status::budgetTooSmall(
      fmt::format("a memory budget of {:.1f} MiB is too small for {}: {} is the least that works",
                  double(memory_bytes) / (1 << 20), work, formatMebibytes(least_bytes)));
}

std::string describeThreads(int threads) {
  return fmt::format("{} {}", threads, threads == 1 ? "thread" : "threads");
}

std::uint64_t leastGatherMemory(const SceneFile& file, const GatherWork& work) {
  return leastBytes(file, work, 0);
}

std::uint64_t gatherMemoryBesideCaches(const SceneFile& file, const GatherWork& work) {
  return fixedBytes(file, work, work.prefetch_threads) +
         work.receivers * (sizeof(SortedReceiver) + resultBytes(work));
}

Result<GatherMemory> planGatherMemory(const SceneFile& file, std::uint64_t memory_bytes,
                                      const GatherWork& work) {
  const std::uint64_t least = leastGatherMemory(file, work);
  if (memory_bytes < least) {
    return refuseBudget(
        memory_bytes, fmt::format("{} with {}", file.path(), describeThreads(work.threads)), least);
  }

  GatherMemory memory;
  memory.work = work;
  const std::uint64_t for_prefetching = least + memory_bytes / kPrefetchPart;
  for (int threads = work.prefetch_threads; threads > 0 && memory.prefetch_threads == 0;
       --threads) {
    const std::uint64_t needed = leastBytes(file, work, threads);
    if (needed <= memory_bytes && needed <= for_prefetching) memory.prefetch_threads = threads;
  }
  const int readers = work.threads + memory.prefetch_threads;
  const std::uint64_t fixed = fixedBytes(file, work, memory.prefetch_threads);
  const std::uint64_t least_receivers = leastReceiverBytes(work);
  const std::uint64_t for_receivers =
      std::min(memory_bytes / kReceiverPart,
               memory_bytes - fixed - PagedOctree::leastCacheBytes(file, readers));
  planReceivers(work, std::max(for_receivers, least_receivers),
                memory_bytes - fixed - least_receivers, memory);
  memory.cache_bytes = memory_bytes - fixed - memory.sorter_reading_bytes - memory.result_bytes;
  SURFEIT_ASSIGN_OR_RETURN(
      memory.caches,
      PagedOctree::planMemory(file, memory.cache_bytes, readers,
                              work.cache_split < 0 ? PagedOctree::kEvenSplit : work.cache_split));
  memory.caches.tracked_pages = kTrackedPages;
  return memory;
}

}  // namespace surfeit
