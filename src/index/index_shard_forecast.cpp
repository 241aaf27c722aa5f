// What an index in shards needs, by the rules of docs/farm.md, "Memory and time of an index". They
// begin with the number of surfels, the bytes of the inputs, and an index of a sample.
#include <fmt/format.h>

#include <algorithm>

#include "core/guard.h"
#include "index/index_plan.h"
#include "index/index_shard_job.h"
#include "octree/build/bucket_stream.h"

namespace surfeit {
namespace {

constexpr double kMega = 1 << 20;
// Files of the distribution and of the build, over the scene (docs/farm.md, "10^11 surfels on
// paper": 55 and 89 bytes a surfel, of 32).
constexpr double kRangesOverScene = 2, kSlabsOverScene = 3;
// The largest range over the mean one: ranges begin near the places that make equal parts.
constexpr double kUnevenRanges = 1.25;
// What each thread beyond the second takes of an index.
constexpr double kThreadBytes = 13 * kMega;
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
// Part of an index that the merge is, beside moving bytes: node pages, and the top of the octree.
constexpr double kMergePart = 0.1;

// The most that any pass of a shard, or the merge, takes: range of the build in memory, or the
// default of an index where that is less, for the rest goes through temporary files.
double memoryOf(const IndexShardForecast& forecast, int threads, int count) {
  const double least = double(kLeastIndexMemory) + kThreadBytes * std::max(0, threads - 2);
  const double records = double(forecast.records);
  const double places = std::max(kSamplePlaces, kRangePlaces * count);
  const double distribute = least + kSampleBytes * places + kRangeBytes * count;
  const double range = kUnevenRanges * records / count;
  const double packed = kUnevenRanges * kRangesOverScene * double(forecast.scene_bytes) / count;
  const double build =
      least + packed + double(BucketStream::kBytesPerSurfel) * std::min(range, kMostBucket);
  const double merge = least + kDirectoryBytes * records;
  return std::max({distribute, std::min(build, double(kUsualIndexMemory)), merge});
}

// `seconds`: of one machine for the whole, without reading and moving files.
void setSeconds(double seconds, bool is_seekable, int count, IndexShardForecast& forecast) {
  const double scene = double(forecast.scene_bytes);
  // What cannot be read at any place is read from its beginning by every task
  const double input = double(forecast.input_bytes) / (is_seekable ? count : 1);
  const double distribute = input + kRangesOverScene * scene / count;
  const double build = (kRangesOverScene + kSlabsOverScene) * scene / count;
  forecast.task_seconds = seconds / count + std::max(distribute, build) / kBytesPerSecond;
  forecast.merge_seconds = kMergePart * seconds + (kSlabsOverScene + 1) * scene / kBytesPerSecond;
}

Status checkSizes(const IndexShardJob& job) {
  if (!job.reader.lacksSizes()) return {};
  return Status::invalidArgument(
      fmt::format("an input has neither radii nor areas: {}", kNeighboursElsewhere));
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
      SURFEIT_RETURN_IF_ERROR(checkSizes(job));
      is_seekable = job.reader.isSeekable();
      threads = job.options.threads;
    }
    SURFEIT_ASSIGN_OR_RETURN(const IndexForecast whole,
                             forecastIndex(inputs, output, options, progress));
    forecast.records = whole.records;
    forecast.sampled_surfels = whole.sampled_surfels;
    forecast.input_bytes = whole.input_bytes;
    forecast.scene_bytes = whole.file_bytes;
    forecast.shard_bytes =
        static_cast<std::uint64_t>((kRangesOverScene + kSlabsOverScene) * double(whole.file_bytes));
    forecast.memory_bytes = static_cast<std::uint64_t>(memoryOf(forecast, threads, count));
    setSeconds(whole.seconds, is_seekable, count, forecast);
    return forecast;
  });
}

}  // namespace surfeit
