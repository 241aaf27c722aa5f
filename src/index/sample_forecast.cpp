#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cloud/channels.h"
#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/seconds_since.h"
#include "index/scene_rows.h"
#include "index/scratch_folder.h"
#include "storage/output_target.h"
#include "surfeit/forecast.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMostRecords = 65536, kRowsOfPlace = 256;

// Writes some rows of a cloud, as they are read.
class RowSample {
 public:
  static Result<RowSample> create(RowReader& reader, const std::string& path) {
    RowSample sample;
    RowWriterOptions writing;
    for (const RowProperty& property : reader.element().properties) {
      if (property.is_list) continue;
      writing.properties.push_back(property);
      sample.from_.push_back(property.offset);
    }
    writing.comments = reader.comments();
    SURFEIT_ASSIGN_OR_RETURN(sample.writer_, createRowWriter(path, writing));
    return sample;
  }

  Status write(Bytes rows, std::size_t row_bytes) {
    const RowLayout& to = writer_->element();
    const std::size_t count = rows.size() / row_bytes;
    packed_.assign(count * to.row_bytes, std::byte{0});
    for (std::size_t p = 0; p < from_.size(); ++p) {
      const RowProperty& property = to.properties[p];
      for (std::size_t i = 0; i < count; ++i) {
        std::memcpy(&packed_[i * to.row_bytes + property.offset], &rows[i * row_bytes + from_[p]],
                    valueTypeBytes(property.type));
      }
    }
    return writer_->writeRows(packed_);
  }
  Status finish() { return writer_->finish(); }

 private:
  std::unique_ptr<RowWriter> writer_;
  std::vector<std::size_t> from_;  // places in a row of the reader
  std::vector<std::byte> packed_;
};

// `most` rows from all over, or of what cannot be sought in the first. Returns how many.
Result<std::uint64_t> sampleCloud(RowReader& reader, std::uint64_t most, const std::string& path) {
  const std::uint64_t count = reader.element().count;
  const std::size_t row_bytes = reader.element().row_bytes;
  SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(reader.element(), reader.path()));
  SURFEIT_ASSIGN_OR_RETURN(RowSample sample, RowSample::create(reader, path));
  const bool takes_places = reader.isSeekable() && count > most && most > kRowsOfPlace;
  const std::uint64_t places = most / kRowsOfPlace;
  const std::uint64_t step = takes_places ? (count - kRowsOfPlace) / places : 0;
  AlignedBuffer buffer;
  std::uint64_t taken = 0;
  while (taken < most) {
    if (takes_places) SURFEIT_RETURN_IF_ERROR(reader.seekRow(taken / kRowsOfPlace * step));
    SURFEIT_ASSIGN_OR_RETURN(
        const Bytes rows,
        reader.readRows(std::size_t(std::min(kRowsOfPlace, most - taken)), buffer));
    if (rows.empty()) break;
    SURFEIT_RETURN_IF_ERROR(sample.write(rows, row_bytes));
    taken += rows.size() / row_bytes;
  }
  SURFEIT_RETURN_IF_ERROR(sample.finish());
  return taken;
}

// The status with the user's own file in the place of every temporary one.
Status statusOf(const Status& status, const std::vector<std::string>& samples,
                const std::vector<std::string>& inputs) {
  std::string message = status.message();
  for (std::size_t i = samples.size(); i-- > 0;) {
    const std::size_t at = message.find(samples[i]);
    if (at != std::string::npos) message.replace(at, samples[i].size(), inputs[i]);
  }
  return {status.code(), message};
}

Result<SampleForecast> forecast(const std::vector<std::string>& inputs, const std::string& output,
                                const RowReaderOptions& reading, const std::string& directory,
                                const SampleJob& job, Progress& progress) {
  // How many records each has
  SampleForecast forecast;
  std::vector<std::unique_ptr<RowReader>> readers;
  for (const std::string& input : inputs) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openCloud(input, reading));
    forecast.records += reader->element().count;
    std::error_code ignored;
    forecast.input_bytes += std::filesystem::file_size(input, ignored);
    readers.push_back(std::move(reader));
  }

  // Samples in proportion
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder,
                           ScratchFolder::create(temporaryDirectory(directory, output)));
  std::vector<std::string> samples;
  const double part =
      std::min(1., double(kMostRecords) / double(std::max<std::uint64_t>(1, forecast.records)));
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    samples.push_back(folder.file(fmt::format("sample{}.ply", i)));
    const auto most = std::uint64_t(std::ceil(part * double(readers[i]->element().count)));
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t taken,
                             sampleCloud(*readers[i], most, samples.back()));
    forecast.sampled_records += taken;
    readers[i].reset();
  }
  if (forecast.sampled_records == 0) return forecast;

  // The job
  const std::string result = folder.file(std::filesystem::path(output).filename().string());
  QuietProgress quiet(progress);
  const auto start = std::chrono::steady_clock::now();
  const Result<std::uint64_t> temporary_bytes = job(samples, result, quiet);
  if (!temporary_bytes.ok()) return statusOf(temporary_bytes.status(), samples, inputs);
  const double times = double(forecast.records) / double(forecast.sampled_records);
  forecast.seconds = secondsSince(start) * times;
  forecast.temporary_bytes = std::uint64_t(double(*temporary_bytes) * times);
  std::error_code ignored;
  forecast.output_bytes =
      std::uint64_t(double(std::filesystem::file_size(result, ignored)) * times);
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
