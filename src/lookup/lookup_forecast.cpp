#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "cloud/rows/channels.h"
#include "core/guard.h"
#include "index/rows/row_sample.h"
#include "index/rows/scene_rows.h"
#include "lookup/baked_map.h"
#include "storage/held_bytes.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"
#include "surfeit/lookup.h"

namespace surfeit {
namespace {

// A sample of a cloud in a folder.
struct CloudSample {
  std::string path;
  std::uint64_t records = 0, sampled_records = 0;
  double times() const {
    return sampled_records > 0 ? double(records) / double(sampled_records) : 0;
  }
};

Result<CloudSample> sampleOf(const std::string& cloud, const std::string& name,
                             const RowReaderOptions& reading, const ScratchFolder& folder) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openCloud(cloud, reading));
  CloudSample sample;
  sample.records = reader->element().count;
  sample.path = folder.file(name);
  SURFEIT_ASSIGN_OR_RETURN(sample.sampled_records,
                           sampleRows(*reader, kMostSampledRows, sample.path));
  return sample;
}

// Passes and volumes are written as they came, which takes all of their pixels or voxels.
bool isWrittenAsItCame(const std::string& result) {
  return result.ends_with(".exr") || result.ends_with(".vdb");
}

double secondsOf(const LookupStats& stats, const char* phase) {
  for (const auto& [name, seconds] : stats.phase_seconds) {
    if (name == phase) return seconds;
  }
  return 0;
}

Result<SampleForecast> forecast(const std::string& map, const std::string& receivers,
                                const std::string& result, const LookupOptions& options,
                                Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result, map, "map"));
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder, ScratchFolder::create(temporaryDirectory(
                                                           options.temporary_directory, result)));
  // The receivers
  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options.channels));
  reading.part = options.part;
  reading.filter = options.filter;
  SURFEIT_ASSIGN_OR_RETURN(reading.color_range,
                           colorRangeFor(std::span(&receivers, 1), result, options.color_range));
  SURFEIT_ASSIGN_OR_RETURN(const CloudSample sampled,
                           sampleOf(receivers, "receivers.ply", reading, folder));
  SampleForecast forecast;
  forecast.records = sampled.records;
  forecast.sampled_records = sampled.sampled_records;
  forecast.input_bytes = fileBytesOf(map) + fileBytesOf(receivers);
  LookupOptions looking = options;
  static_cast<ReadOptions&>(looking) = {};

  // The map: of a cloud a sample, too
  CloudSample of_map = {map, 1, 1};
  if (!isBrickMap(map)) {
    RowReaderOptions of_points;
    SURFEIT_ASSIGN_OR_RETURN(of_points.channels, parseChannelRenames(options.map_channels));
    of_points.filter = options.map_filter;
    SURFEIT_ASSIGN_OR_RETURN(of_map, sampleOf(map, "map.ply", of_points, folder));
    looking.map_channels = looking.map_filter = {};
  }

  const bool is_as_it_came = isWrittenAsItCame(result);
  const std::string output = is_as_it_came ? folder.file("result.ply") : folder.fileLike(result);
  SilentProgress silent(progress);
  const HeldBytesLog held;
  const Result<LookupStats> looked_up =
      lookupCloud(of_map.path, sampled.path, output, looking, silent);
  if (!looked_up.ok()) {
    const Status status = withName(looked_up.status(), of_map.path, map);
    return withName(withName(status, sampled.path, receivers), output, result);
  }
  const LookupStats& stats = *looked_up;
  forecast.memory_bytes = stats.memory_bytes;
  forecast.temporary_bytes = std::uint64_t(double(stats.temporary_bytes) * of_map.times()) +
                             held.spilledOf(of_map.times());
  forecast.seconds =
      secondsOf(stats, "open") * of_map.times() + secondsOf(stats, "look up") * sampled.times();
  const std::uint64_t written = fileBytesOf(output), read = fileBytesOf(sampled.path);
  forecast.output_bytes =
      is_as_it_came ? fileBytesOf(receivers) +
                          std::uint64_t(double(written - std::min(written, read)) * sampled.times())
                    : std::uint64_t(double(written) * sampled.times());
  return forecast;
}

}  // namespace

Result<SampleForecast> forecastLookup(const std::string& map, const std::string& receivers,
                                      const std::string& result, const LookupOptions& options,
                                      Progress& progress) {
  return guarded(result, [&] { return forecast(map, receivers, result, options, progress); });
}

}  // namespace surfeit
