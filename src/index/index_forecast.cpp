#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <memory>

#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/seconds_since.h"
#include "index/rows/scene_rows.h"
#include "index/steps/cloud_reader.h"
#include "index/steps/group_plan.h"
#include "index/steps/index_neighbours.h"
#include "index/steps/index_plan.h"
#include "octree/neighbours/repeated_surfels.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

// Places from all over, or where that takes reading everything, the first.
Result<std::vector<Surfel>> takeSample(const CloudReader& reader, const std::string& first_input,
                                       const RowReaderOptions& reading) {
  if (reader.isSeekable()) return reader.sample(usualBucketCount(reader.recordCount()));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SurfelSource> source,
                           openCloudSource(first_input, false, reading));
  std::vector<Surfel> surfels(std::min<std::uint64_t>(kSampleSurfels, source->recordCount()));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, source->read(surfels));
  surfels.resize(count);
  return surfels;
}

Result<IndexForecast> forecast(const std::vector<std::string>& inputs, const std::string& output,
                               const IndexOptions& options, Progress& progress) {
  IndexForecast forecast;
  forecast.memory_bytes = options.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, readingOf(options));
  SURFEIT_ASSIGN_OR_RETURN(
      const CloudReader reader,
      CloudReader::open(inputs, options.strict, readBytesWithin(options.memory_bytes), reading));
  forecast.records = reader.recordCount();
  forecast.input_bytes = reader.fileBytes();
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<Surfel> sample,
                           takeSample(reader, inputs[0], reading));
  forecast.sampled_surfels = sample.size();
  if (sample.empty()) return forecast;

  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder, ScratchFolder::create(temporaryDirectory(
                                                           options.temporary_directory, output)));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SurfelSource> source,
                           openCloudSource(inputs[0], false, reading));
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer,
                           SurfelWriter::create(folder.file("sample.ply"), source->channels()));
  SURFEIT_RETURN_IF_ERROR(writer.write(sample));
  SURFEIT_RETURN_IF_ERROR(writer.finish());

  IndexOptions indexing = options;
  indexing.channels = indexing.part = indexing.filter = {};
  indexing.origin.reset();
  indexing.cube.reset();
  indexing.named.clear();
  indexing.strict = false;
  SilentProgress quiet(progress);
  const auto start = std::chrono::steady_clock::now();
  SURFEIT_ASSIGN_OR_RETURN(
      const IndexStats stats,
      indexClouds({folder.file("sample.ply")}, folder.file("sample.sft"), indexing, quiet));
  const double times = double(forecast.records) / double(stats.surfels);
  forecast.seconds = secondsSince(start) * times;
  forecast.file_bytes = std::uint64_t(double(stats.file_bytes) * times);
  forecast.temporary_bytes = std::uint64_t(double(stats.temporary_bytes) * times);

  const SlabForm form = {options.leaf_capacity,
                         options.full_precision || reader.lacksSizes() || options.normals};
  const double packed_bytes = packedBytesPerSurfel(sample);
  SURFEIT_ASSIGN_OR_RETURN(
      const IndexPlan plan,
      planIndex({options.memory_bytes, options.threads, forecast.records, packed_bytes, form,
                 options.normals ? leastNeighbourBytes(*options.normals, options.threads) : 0,
                 options.repeats == Repeats::kThin ? RepeatFilter::kBytesPerSurfel : 0}));
  if (plan.spills) {
    forecast.temporary_bytes += std::uint64_t(double(forecast.records) * packed_bytes);
  }
  return forecast;
}

}  // namespace

Result<IndexForecast> forecastIndex(const std::vector<std::string>& inputs,
                                    const std::string& output, const IndexOptions& given,
                                    Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const GroupPlan groups, planGroups(inputs, given.named, true));
  if (groups.inputs.empty()) return Status::invalidArgument("index: no input cloud");
  IndexOptions options = given;
  if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualIndexMemory);
  if (options.threads <= 0) {
    options.threads =
        threadsWithin(options.memory_bytes, {options.leaf_capacity, options.full_precision},
                      defaultThreadCount());
  }
  Result<IndexForecast> result = Status::failed("index: no forecast");
  try {
    withThreads(options.threads,
                [&] { result = forecast(groups.inputs, output, options, progress); });
  } catch (const std::exception& error) {
    return Status::failed(output + ": " + error.what());
  }
  return result;
}

}  // namespace surfeit
