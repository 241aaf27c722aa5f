#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/guard.h"
#include "core/seconds_since.h"
#include "index/rows/row_sample.h"
#include "index/rows/scene_rows.h"
#include "storage/held_bytes.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"
#include "surfeit/forecast.h"

namespace surfeit {
namespace {

Result<SampleForecast> forecast(const std::vector<std::string>& inputs, const std::string& output,
                                const RowReaderOptions& reading, const std::string& directory,
                                const SampleJob& job, Progress& progress) {
  // How many records each has
  SampleForecast forecast;
  std::vector<std::unique_ptr<RowReader>> readers;
  for (const std::string& input : inputs) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openCloud(input, reading));
    forecast.records += reader->element().count;
    forecast.input_bytes += fileBytesOf(input);
    readers.push_back(std::move(reader));
  }

  // Samples in proportion
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder,
                           ScratchFolder::create(temporaryDirectory(directory, output)));
  std::vector<std::string> samples;
  const double part =
      std::min(1., double(kMostSampledRows) / double(std::max<std::uint64_t>(1, forecast.records)));
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    samples.push_back(folder.file(fmt::format("sample{}.ply", i)));
    const auto most = std::uint64_t(std::ceil(part * double(readers[i]->element().count)));
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t taken,
                             sampleRows(*readers[i], most, samples.back()));
    forecast.sampled_records += taken;
    readers[i].reset();
  }
  if (forecast.sampled_records == 0) return forecast;

  // The job
  const std::string result = folder.fileLike(output);
  SilentProgress quiet(progress);
  const auto start = std::chrono::steady_clock::now();
  const HeldBytesLog held;
  const Result<std::uint64_t> temporary_bytes = job(samples, result, quiet);
  if (!temporary_bytes.ok()) {
    Status status = temporary_bytes.status();
    for (std::size_t i = samples.size(); i-- > 0;) status = withName(status, samples[i], inputs[i]);
    return withName(status, result, output);
  }
  const double times = double(forecast.records) / double(forecast.sampled_records);
  forecast.seconds = secondsSince(start) * times;
  forecast.temporary_bytes =
      std::uint64_t(double(*temporary_bytes) * times) + held.spilledOf(times);
  forecast.output_bytes = std::uint64_t(double(fileBytesOf(result)) * times);
  return forecast;
}

}  // namespace

Result<SampleForecast> forecastBySample(const std::vector<std::string>& inputs,
                                        const std::string& output, const ReadOptions& given,
                                        const std::string& temporary_directory,
                                        const SampleJob& job, Progress& progress) {
  return guarded(output, [&]() -> Result<SampleForecast> {
    RowReaderOptions reading;
    SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(given.channels));
    reading.part = given.part;
    reading.filter = given.filter;
    reading.color_range = given.color_range;
    return forecast(inputs, output, reading, temporary_directory, job, progress);
  });
}

}  // namespace surfeit
