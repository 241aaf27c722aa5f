#include "octree/index_plan.h"

#include <algorithm>
#include <cmath>

#include "core/curve_key.h"
#include "octree/bucket_stream.h"
#include "octree/cloud_reader.h"
#include "octree/octree_builder.h"
#include "octree/surfel_block.h"

namespace surfeit {
namespace {

// Buckets are this much smaller on average than the largest that fits: a sample of 64 surfels for
// each is off by a fifth, and neighbours in a file make it worse.
constexpr double kUnevenness = 1.6;
constexpr std::size_t kMaxBuckets = 4096;
constexpr std::size_t kMaxBlockSurfels = 2048, kMinBlockSurfels = 64;
// Buffers of the file being written and of the temporary file, and zstd.
constexpr std::uint64_t kFileBytes = 12 << 20;
// Bytes of the page directory per surfel: 24 for each surfel page, and each node page.
constexpr double kDirectoryBytes = 0.1;
// Larger buckets than this gain nothing, and their memory has to be touched for a first time; fewer
// than so many buckets do no harm.
constexpr std::size_t kUsefulBucket = 1 << 20;
constexpr double kFewBuckets = 1024;

}  // namespace

IndexPlan planIndex(std::uint64_t memory_bytes, int threads, std::uint64_t records,
                    double packed_bytes) {
  constexpr std::uint64_t kMega = 1 << 20;
  IndexPlan plan;
  plan.read_bytes =
      static_cast<std::size_t>(std::clamp<std::uint64_t>(memory_bytes / 256, kMega / 4, 4 * kMega));

  // What is taken in any case, while reading and while building
  const auto left = [memory_bytes](std::uint64_t taken) {
    return memory_bytes > taken + kMega ? memory_bytes - taken : kMega;
  };
  const std::uint64_t directory = static_cast<std::uint64_t>(double(records) * kDirectoryBytes);
  const std::uint64_t reading =
      left(CloudReader::memoryBytes(plan.read_bytes, threads) + kFileBytes);
  const std::uint64_t building = left(buildOctreeBytes(threads) + directory + kFileBytes);

  // All in memory: blocks stay while buckets are sorted
  const double packed_total = double(records) * packed_bytes * 1.05 + double(8 * kMega);
  const std::uint64_t small = std::clamp<std::uint64_t>(records, 1024, kUsefulBucket);
  const std::uint64_t small_bytes = small * BucketStream::kBytesPerSurfel;
  plan.spills = packed_total + double(small_bytes) > double(std::min(reading, building));
  if (!plan.spills) {
    plan.block_memory = static_cast<std::uint64_t>(packed_total);
    plan.bucket_capacity = static_cast<std::size_t>(small);
  } else {
    const std::uint64_t useful = std::max<std::uint64_t>(
        kUsefulBucket, static_cast<std::uint64_t>(double(records) * kUnevenness / kFewBuckets));
    plan.bucket_capacity = static_cast<std::size_t>(
        std::clamp<std::uint64_t>(building / BucketStream::kBytesPerSurfel, 1024, useful));
  }
  const double buckets = std::ceil(double(records) * kUnevenness / double(plan.bucket_capacity));
  plan.bucket_count = records <= plan.bucket_capacity
                          ? 1
                          : static_cast<std::size_t>(std::clamp(buckets, 2.0, double(kMaxBuckets)));
  const std::uint64_t open_bytes = plan.spills ? reading / 2 : small_bytes;
  plan.block_surfels = static_cast<std::size_t>(std::clamp<std::uint64_t>(
      open_bytes / (plan.bucket_count * sizeof(Surfel)), kMinBlockSurfels, kMaxBlockSurfels));
  return plan;
}

double packedBytesPerSurfel(std::span<const Surfel> sample) {
  if (sample.empty()) return sizeof(Surfel);
  std::vector<std::byte> packed;
  packSurfels(sample, packed);
  return double(packed.size()) / double(sample.size());
}

std::vector<SortWord> splittersOf(std::span<const Surfel> sample, const RootCube& cube,
                                  std::size_t bucket_count) {
  std::vector<SortWord> words(sample.size()), splitters;
  if (words.empty()) return splitters;
  curveKeys(&sample.front().position, sizeof(Surfel), cube, words);
  std::sort(words.begin(), words.end());
  for (std::size_t b = 1; b < bucket_count; ++b) {
    splitters.push_back(words[words.size() * b / bucket_count]);
  }
  splitters.erase(std::unique(splitters.begin(), splitters.end()), splitters.end());
  return splitters;
}

}  // namespace surfeit
