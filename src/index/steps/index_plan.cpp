#include "index/steps/index_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/curve_key.h"
#include "core/job_limits.h"
#include "core/program_memory.h"
#include "core/surfel_limits.h"
#include "index/steps/cloud_reader.h"
#include "index/steps/pinned_cube.h"
#include "octree/build/bucket_stream.h"
#include "octree/build/surfel_block.h"
#include "octree/neighbours/normal_rule.h"
#include "storage/held_bytes.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMega = 1 << 20;
// Buckets are this much smaller on average than the largest that fits: a sample of 64 surfels for
// each is off by a fifth, and neighbours in a file make it worse.
constexpr double kUnevenness = 1.6;
constexpr std::size_t kMaxBuckets = 4096;
// Smaller blocks than these make lists long and reads short.
constexpr std::size_t kMaxBlockSurfels = 2048, kMinBlockSurfels = 512;
// Buffers of the file being written and of the temporary file, and zstd.
constexpr std::uint64_t kFileBytes = 12 * kMega;
// Larger buckets than this gain nothing, and their memory has to be touched for a first time, which
// costs as much as the disk; fewer than so many buckets do no harm.
constexpr std::uint64_t kUsefulBucket = 1 << 20;
constexpr std::uint64_t kFewBuckets = 1024;
// Part of what is left for building that buckets are planned to take: the allocator, buffers that
// round up and what threads keep take the rest (measured: 40 MiB of 256).
constexpr double kBucketShare = 0.75;
// Smaller buckets than this are not worth their seams.
constexpr std::uint64_t kLeastBucket = 32768;
// Buckets of so many times the least size are no hindrance.
constexpr std::uint64_t kEasyBuckets = 4;

// Page directory of the scene, 24 bytes a page: the only thing, with the list of blocks, that grows
// with the cloud.
std::uint64_t directoryBytes(const IndexTask& task) {
  constexpr double kEntry = 24, kSurfelsPerPage = 480, kNodesPerPage = 120;
  return static_cast<std::uint64_t>(
      double(task.records) * kEntry *
      (1 / kSurfelsPerPage + task.slabs.nodesPerSurfel() / kNodesPerPage));
}

// List of blocks; vectors grow by doubling.
std::uint64_t blockListBytes(std::uint64_t records, std::size_t block_surfels) {
  return 3 * sizeof(SurfelStore::Block) / 2 * (records / block_surfels);
}

// Buckets for a capacity, and blocks for the room that open ones may take.
void planBuckets(std::uint64_t records, std::uint64_t open_bytes, IndexPlan& plan) {
  const double buckets = std::ceil(double(records) * kUnevenness / double(plan.bucket_capacity));
  const double most = std::clamp(double(open_bytes / (kMinBlockSurfels * sizeof(Surfel))), 1.0,
                                 double(kMaxBuckets));
  plan.bucket_count = records <= plan.bucket_capacity
                          ? 1
                          : static_cast<std::size_t>(std::clamp(buckets, 1.0, most));
  plan.block_surfels = static_cast<std::size_t>(std::clamp<std::uint64_t>(
      open_bytes / (plan.bucket_count * sizeof(Surfel)), kMinBlockSurfels, kMaxBlockSurfels));
}

}  // namespace

Status checkIndexOptions(const IndexOptions& options) {
  if (options.leaf_capacity < 1 || options.leaf_capacity > 4096) {
    return Status::invalidArgument(
        fmt::format("leaf capacity {}, expected 1 to 4096", options.leaf_capacity));
  }
  for (int axis = 0; options.origin && axis < 3; ++axis) {
    if (std::abs((*options.origin)[axis]) <= double(kLargestLength)) continue;
    return Status::invalidArgument(
        fmt::format("origin {}, expected a number of at most 1e12", (*options.origin)[axis]));
  }
  if (options.cube) SURFEIT_RETURN_IF_ERROR(PinnedCube::check(*options.cube));
  if (options.normals) {
    SURFEIT_RETURN_IF_ERROR(NormalRule::check(*options.normals));
    if (options.normals->orientation.toward == NormalOrientation::Toward::kTrajectory) {
      return Status::invalidArgument(
          "surfels of a scene have no time: find normals by a trajectory with surfeit normals");
    }
  }
  if (!(options.disk_overlap >= 1 && options.disk_overlap <= 16)) {
    return Status::invalidArgument(
        fmt::format("disk overlap {}, expected 1 to 16", options.disk_overlap));
  }
  return {};
}

Result<RowReaderOptions> readingOf(const IndexOptions& options) {
  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options.channels));
  reading.part = options.part;
  reading.filter = options.filter;
  reading.selections = std::make_shared<RowSelections>();
  reading.color_range = options.color_range;
  return reading;
}

std::size_t readBytesWithin(std::uint64_t memory_bytes) {
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(memory_bytes / 256, kMega / 4, 4 * kMega));
}

std::uint64_t usualBucketCount(std::uint64_t records) {
  return std::min<std::uint64_t>(
      kFewBuckets, static_cast<std::uint64_t>(double(records) * kUnevenness) / kUsefulBucket + 1);
}

int threadsWithin(std::uint64_t memory_bytes, const SlabForm& slabs, int wanted) {
  const std::size_t read_bytes = readBytesWithin(memory_bytes);
  int threads = wanted;
  while (threads > 1 &&
         std::max(CloudReader::memoryBytes(read_bytes, threads),
                  buildOctreeBytes(slabs, threads, usualSlabs(threads))) > memory_bytes / 2) {
    --threads;
  }
  return threads;
}

int indexThreads(const IndexOptions& options, Progress& progress) {
  if (options.threads > 0) return options.threads;
  const int available = defaultThreadCount();
  const int threads = threadsWithin(options.memory_bytes,
                                    {options.leaf_capacity, options.full_precision}, available);
  if (threads < available) {
    progress.inform(fmt::format("{} of {} threads: a budget of {} MiB feeds no more", threads,
                                available, options.memory_bytes >> 20));
  }
  return threads;
}

Result<IndexPlan> planIndex(const IndexTask& task) {
  IndexPlan plan;
  plan.read_bytes = readBytesWithin(task.memory_bytes);

  // What is taken in any case, while reading and while building
  const std::uint64_t lists = blockListBytes(task.records, kMinBlockSurfels);
  const std::uint64_t beside = programBytes(task.threads) + kFileBytes + lists;
  const std::uint64_t read_fixed = CloudReader::memoryBytes(plan.read_bytes, task.threads) + beside;
  const auto buildFixed = [&](std::size_t slabs) {
    return buildOctreeBytes(task.slabs, task.threads, slabs) + directoryBytes(task) + beside;
  };
  plan.slabs = fewestSlabs(task.threads);
  const std::size_t surfel_bytes = BucketStream::kBytesPerSurfel + task.filter_bytes;
  const std::uint64_t least_bucket =
      std::max(std::min(kLeastBucket, task.records) * surfel_bytes, task.search_bytes);
  const std::uint64_t least = std::max({kLeastIndexMemory, buildFixed(plan.slabs) + least_bucket,
                                        read_fixed + 64 * kMinBlockSurfels * sizeof(Surfel)});
  if (task.memory_bytes < least) {
    return Status::budgetTooSmall(fmt::format(
        "--memory of {} MiB is too small to index {} records with {} threads: {} MiB is "
        "the least that works",
        task.memory_bytes >> 20, task.records, task.threads, (least + kMega - 1) >> 20));
  }
  // More slabs where they leave buckets large enough
  const std::size_t usual = usualSlabs(task.threads);
  if (task.memory_bytes >= buildFixed(usual) + kEasyBuckets * least_bucket) plan.slabs = usual;
  const std::uint64_t build_fixed = buildFixed(plan.slabs);
  const std::uint64_t reading = task.memory_bytes - read_fixed;
  const std::uint64_t building = task.memory_bytes - build_fixed;
  plan.octree_memory = building;

  // All in memory: blocks stay while buckets are sorted
  const std::uint64_t packed =
      static_cast<std::uint64_t>(double(task.records) * task.packed_bytes * 1.05) + 8 * kMega;
  const std::uint64_t bucket = std::clamp<std::uint64_t>(task.records, 1024, kUsefulBucket);
  const std::uint64_t bucket_bytes = bucket * surfel_bytes;
  plan.spills = packed + bucket_bytes > std::min(reading, building);
  if (!plan.spills) {
    noteHeldBytes(static_cast<std::uint64_t>(double(task.records) * task.packed_bytes),
                  std::min(reading, building) - bucket_bytes);
    plan.block_memory = packed;
    plan.spare_memory = std::min(reading, building) - packed - bucket_bytes;
    plan.bucket_capacity = static_cast<std::size_t>(bucket);
    planBuckets(task.records, bucket_bytes, plan);
    return plan;
  }
  const std::uint64_t useful = std::max(
      kUsefulBucket, static_cast<std::uint64_t>(double(task.records) * kUnevenness) / kFewBuckets);
  plan.bucket_capacity = static_cast<std::size_t>(std::clamp<std::uint64_t>(
      static_cast<std::uint64_t>(double(building) * kBucketShare) / surfel_bytes, 1024, useful));
  planBuckets(task.records, reading / 2, plan);
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
