// How the indexer divides its memory. docs/architecture.md, "Memory of the indexer", has the sum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/bounds.h"
#include "octree/surfel_store.h"
#include "surfeit/surfel.h"

namespace surfeit {

// The least that indexClouds accepts.
inline constexpr std::uint64_t kLeastIndexMemory = 64 << 20;

struct IndexPlan {
  std::size_t read_bytes = 0;       // of the input at once
  std::size_t bucket_capacity = 0;  // surfels that are sorted at once
  std::size_t bucket_count = 1;     // for an even distribution with room for an uneven one
  std::size_t block_surfels = 0;    // surfels packed at once; every bucket has room for them
  std::uint64_t block_memory = 0;   // for packed blocks, before they go to a temporary file
  bool spills = false;              // the input is expected not to fit block_memory
};

// For at most `records` surfels of about `packed_bytes` each.
IndexPlan planIndex(std::uint64_t memory_bytes, int threads, std::uint64_t records,
                    double packed_bytes);

// Bytes per surfel when packed, measured on a sample: about what they will take, since a sample is
// less alike than neighbours.
double packedBytesPerSurfel(std::span<const Surfel> sample);

// Words that divide the curve into `bucket_count` buckets of equal numbers of sample surfels.
std::vector<SortWord> splittersOf(std::span<const Surfel> sample, const RootCube& cube,
                                  std::size_t bucket_count);

}  // namespace surfeit
