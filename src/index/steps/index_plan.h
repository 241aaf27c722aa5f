// How the indexer divides its memory. docs/architecture.md, "Memory", has the sums.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cloud/cloud_formats.h"
#include "core/bounds.h"
#include "octree/build/octree_builder.h"
#include "octree/build/surfel_store.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// The least that indexClouds accepts; many threads and many surfels need more.
inline constexpr std::uint64_t kLeastIndexMemory = 64 << 20;
// What it takes unless it is told, at most.
inline constexpr std::uint64_t kUsualIndexMemory = 1 << 30;

// What has to be planned for.
struct IndexTask {
  std::uint64_t memory_bytes = 0;
  int threads = 1;
  std::uint64_t records = 0;  // at most so many surfels
  double packed_bytes = 64;   // of a surfel in a packed block, about
  SlabForm slabs;
  std::uint64_t search_bytes = 0;  // that searches of neighbours take at least
  std::size_t filter_bytes = 0;    // per surfel of a bucket, of a filter behind it
};

struct IndexPlan {
  std::size_t read_bytes = 0;       // of the input at once
  std::size_t bucket_capacity = 0;  // surfels that are sorted at once
  std::size_t bucket_count = 1;     // so many that an uneven distribution fits too
  std::size_t block_surfels = 0;    // surfels packed at once; every bucket has room for them
  std::uint64_t block_memory = 0;   // for packed blocks, before they go to a temporary file
  std::uint64_t spare_memory = 0;   // for blocks of buckets that are distributed again
  std::uint64_t octree_memory = 0;  // what reading the octree of bare positions may take
  std::size_t slabs = 0;            // on their way at a time, of buildOctree
  bool spills = false;              // the blocks are not expected to fit in memory
};

// Threads that a budget can feed: no more than take half of it, of those wanted.
int threadsWithin(std::uint64_t memory_bytes, const SlabForm& slabs, int wanted);

// Those of a job: as many as it asks for, else as the budget feeds, which is told where these are
// fewer than there are processors.
int indexThreads(const IndexOptions& options, Progress& progress);

// kBudgetTooSmall, with the least that works, when it cannot be done.
Result<IndexPlan> planIndex(const IndexTask& task);

// kInvalidArgument for options that no cloud can be indexed with.
Status checkIndexOptions(const IndexOptions& options);

// How the inputs are opened.
Result<RowReaderOptions> readingOf(const IndexOptions& options);

// Bytes that are read at once within a budget.
std::size_t readBytesWithin(std::uint64_t memory_bytes);

// Bytes per surfel when packed, measured on a sample: about what they will take, since a sample is
// less alike than neighbours.
double packedBytesPerSurfel(std::span<const Surfel> sample);

// Buckets that a cloud gets when the budget does not ask for more.
std::uint64_t usualBucketCount(std::uint64_t records);

// Words that divide the curve into `bucket_count` buckets of equal numbers of sample surfels.
std::vector<SortWord> splittersOf(std::span<const Surfel> sample, const RootCube& cube,
                                  std::size_t bucket_count);

}  // namespace surfeit
