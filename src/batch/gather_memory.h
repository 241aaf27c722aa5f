// How the memory budget of a gather is spent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "cloud/rows/row_layout.h"
#include "gather/rules/gather_rules.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/status.h"

namespace surfeit {

// Rows read or written between two looks at Progress::isCancelled, and of the buffers for rows.
inline constexpr std::size_t kSliceRows = 4096;
// Sorted receivers that the threads and those that prefetch can see.
inline constexpr std::size_t kQueueReceivers = 16384;

// What is gathered, as far as memory is concerned.
struct GatherWork {
  std::uint64_t receivers = 0;
  std::size_t input_row_bytes = 0, result_row_bytes = 0;
  GatherRules rules{GatherMode::kOcclusion, {}};
  int threads = 1;
  int prefetch_threads = 0;  // wanted
  double cache_split = -1;   // as in GatherOptions
  // What others hold meanwhile: an environment.
  std::uint64_t held_bytes = 0;
};

// The work of a gather at an element of receivers; threads as options have them (not 0).
GatherWork gatherWork(const RowLayout& receivers, const GatherOptions& options);

struct GatherMemory {
  std::uint64_t sorter_bytes = 0, sorter_reading_bytes = 0;  // of ExternalSorter
  std::uint64_t result_bytes = 0;                            // of ResultStore
  std::uint64_t cache_bytes = 0;                             // of both caches
  PagedOctree::Memory caches;
  int prefetch_threads = 0;  // for which there is memory
  GatherWork work;           // that it was planned for
};

// "5.9 MiB", rounded up.
std::string formatMebibytes(std::uint64_t bytes);

// kBudgetTooSmall: so much for this work is less than the least that works.
Status refuseBudget(std::uint64_t memory_bytes, const std::string& work, std::uint64_t least_bytes);
// "1 thread", "4 threads".
std::string describeThreads(int threads);

// The least budget in which a gather works.
std::uint64_t leastGatherMemory(const SceneFile& file, const GatherWork& work);

// All but the caches, with receivers and results in memory. For advice: this and the bytes of the
// caches are a budget that spends so much on them.
std::uint64_t gatherMemoryBesideCaches(const SceneFile& file, const GatherWork& work);

// Up to a quarter of the budget goes to receivers and results, what is fixed to what is fixed, and
// all the rest to the caches. While receivers are sorted, caches are empty, and their memory serves
// the sorting. kBudgetTooSmall, naming the least that works.
Result<GatherMemory> planGatherMemory(const SceneFile& file, std::uint64_t memory_bytes,
                                      const GatherWork& work);

}  // namespace surfeit
