// What an index in shards needs, by the rules of docs/farm.md, "Memory and time of an index". They
// begin with the number of surfels, the bytes of the inputs, and an index of a sample.
#include <fmt/format.h>

#include <algorithm>

#include "core/guard.h"
#include "index/shards/index_shard_job.h"
#include "index/steps/index_neighbours.h"
#include "index/steps/index_plan.h"
#include "octree/build/bucket_stream.h"

namespace surfeit {
namespace {

constexpr double kMegabyte = 1 << 20;
// Files of the distribution and of the build, over the scene (docs/farm.md, "10^11 surfels on
// paper": 55 and 89 bytes a surfel, of 32).
constexpr double kRangesOverScene = 2, kSlabsOverScene = 3;
// The largest range over the mean one: ranges begin near the places that make equal parts.
constexpr double kUnevenRanges = 1.25;
// What each thread beyond the second takes of an index.
constexpr double kThreadBytes = 13 * kMegabyte;
// Open and full blocks of a range while surfels are distributed.
constexpr double kRangeBytes = 128 << 10;
// The sample of places, with keys.
constexpr double kSampleBytes = 76, kSamplePlaces = 65536, kRangePlaces = 64;
// Page directory of the scene and lists of blocks, of a surfel.
constexpr double kDirectoryBytes = 0.2;
// Buckets need no more than this at once (useful bucket of index_plan.cpp).
constexpr double kMostBucket = 1 << 20;
// What is read and written in a second by one of many tasks on a shared file system.
constexpr double kBytesPerSecond = 100e6;
// Files at full precision, of a surfel: slabs of places, and the scene of places.
constexpr double kPlaceSlabBytes = 100, kPlaceBytes = 40;
// Caches of what neighbours are looked up in.
constexpr double kSearchCacheBytes = 64 * kMegabyte;
// Part of an index that finding sides and building anew is.
constexpr double kSidesPart = 0.5;
// Part of an index that the merge is, beside moving bytes: node pages, and the top of the octree.
constexpr double kMergePart = 0.1;

bool needsSides(const IndexOptions& options) {
  return options.normals &&
         options.normals->orientation.toward == NormalOrientation::Toward::kConsistent;
}

// That of searches, beside the directory of what they look up.
double searchBytes(const std::optional<NormalEstimation>& normals, int threads) {
  return double(leastNeighbourBytes(normals, threads)) + kSearchCacheBytes;
}

// The most that any pass of a shard, or the merge, takes: range of the build in memory, or the
// default of an index where that is less, for the rest goes through temporary files.
double memoryOf(const IndexShardForecast& forecast, const IndexOptions& options, int threads,
                int count) {
  const double least = double(kLeastIndexMemory) + kThreadBytes * std::max(0, threads - 2);
  const double records = double(forecast.records);
  const double places = std::max(kSamplePlaces, kRangePlaces * count);
  const double distribute = least + kSampleBytes * places + kRangeBytes * count;
  const double range = kUnevenRanges * records / count;
  const double packed = kUnevenRanges * kRangesOverScene * double(forecast.scene_bytes) / count;
  const double build =
      least + packed + double(BucketStream::kBytesPerSurfel) * std::min(range, kMostBucket);
  double merge = least + kDirectoryBytes * records;
  if (forecast.may_need_neighbours) {
    // The scene of places has a directory, too
    merge += kDirectoryBytes * records + searchBytes(options.normals, threads);
  }
  return std::max({distribute, std::min(build, double(kUsualIndexMemory)), merge});
}

// `seconds`: of one machine for the whole, without reading and moving files.
void setSeconds(double seconds, bool is_seekable, bool has_sides, int count,
                IndexShardForecast& forecast) {
  const double scene = double(forecast.scene_bytes);
  // What cannot be read at any place is read from its beginning by every task
  const double input = double(forecast.input_bytes) / (is_seekable ? count : 1);
  const double distribute = input + kRangesOverScene * scene / count;
  double build = (kRangesOverScene + kSlabsOverScene) * scene / count;
  double merge = (kSlabsOverScene + 1) * scene;
  if (forecast.may_need_neighbours) {
    const double records = double(forecast.records);
    const double sizes = (kPlaceBytes * records + kSlabsOverScene * scene) / count;
    build = std::max((kRangesOverScene * scene + kPlaceSlabBytes * records) / count, sizes);
    merge = std::max(merge, (kPlaceSlabBytes + kPlaceBytes) * records);
  }
  forecast.task_seconds = seconds / count + std::max(distribute, build) / kBytesPerSecond;
  forecast.merge_seconds =
      (kMergePart + (has_sides ? kSidesPart : 0)) * seconds + merge / kBytesPerSecond;
}

double shardBytes(const IndexShardForecast& forecast) {
  const double files = (kRangesOverScene + kSlabsOverScene) * double(forecast.scene_bytes);
  if (!forecast.may_need_neighbours) return files;
  return files + (kPlaceSlabBytes + kPlaceBytes) * double(forecast.records);
}

}  // namespace

Result<IndexShardForecast> forecastIndexShards(const std::vector<std::string>& inputs,
                                               const std::string& output,
                                               const IndexOptions& options, int count,
                                               Progress& progress) {
  return guarded(output, [&]() -> Result<IndexShardForecast> {
    if (count < 1 || count > kMostShards) {
      return Status::invalidArgument(
          fmt::format("{} shards, expected 1 to {}", count, kMostShards));
    }
    IndexShardForecast forecast;
    bool is_seekable = true;
    int threads = 1;
    {
      SURFEIT_ASSIGN_OR_RETURN(const IndexShardJob job,
                               IndexShardJob::open(inputs, output, options, count, progress));
      is_seekable = job.reader.isSeekable();
      forecast.may_need_neighbours = job.mayNeedNeighbours();
      threads = job.options.threads;
    }
    SURFEIT_ASSIGN_OR_RETURN(const IndexForecast whole,
                             forecastIndex(inputs, output, options, progress));
    forecast.records = whole.records;
    forecast.sampled_surfels = whole.sampled_surfels;
    forecast.input_bytes = whole.input_bytes;
    forecast.scene_bytes = whole.file_bytes;
    forecast.shard_bytes = static_cast<std::uint64_t>(shardBytes(forecast));
    forecast.memory_bytes = static_cast<std::uint64_t>(memoryOf(forecast, options, threads, count));
    setSeconds(whole.seconds, is_seekable, needsSides(options), count, forecast);
    return forecast;
  });
}

Result<bool> mayNeedNeighbours(const std::vector<std::string>& inputs,
                               const IndexOptions& options) {
  return guarded(inputs.empty() ? "index" : inputs.front(), [&]() -> Result<bool> {
    SURFEIT_ASSIGN_OR_RETURN(const GroupPlan groups, planGroups(inputs, options.named, true));
    SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, readingOf(options));
    SURFEIT_ASSIGN_OR_RETURN(const CloudReader reader,
                             CloudReader::open(groups.inputs, /* strict= */ false,
                                               readBytesWithin(kLeastIndexMemory), reading));
    return reader.lacksSizes() || options.normals.has_value();
  });
}

}  // namespace surfeit
