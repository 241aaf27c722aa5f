#include <cstddef>
#include <vector>

#include "batch/gather_options.h"
#include "batch/sorted_receiver.h"
#include "core/guard.h"
#include "gather/rules/gather_outputs.h"
#include "storage/file.h"
#include "surfeit/tune.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kForecastSample = 50'000;

// The last row of the curve that a budget reaches.
const TuneRow& rowFor(const TuneReport& report, std::uint64_t memory_bytes) {
  const TuneRow* found = &report.rows.front();
  for (const std::vector<TuneRow>* rows : {&report.rows, &report.curve}) {
    for (const TuneRow& row : *rows) {
      const bool is_reached = row.memory_bytes <= memory_bytes;
      if (is_reached && row.memory_bytes > found->memory_bytes) found = &row;
    }
  }
  return *found;
}

}  // namespace

Result<GatherForecast> forecastGather(const std::string& scene_path,
                                      const std::string& receivers_path,
                                      const GatherOptions& options, Progress& progress) {
  return guarded(receivers_path, [&]() -> Result<GatherForecast> {
    TuneOptions tuning;
    tuning.gather = options;
    tuning.sample_receivers = kForecastSample;
    SURFEIT_ASSIGN_OR_RETURN(const TuneReport report,
                             tuneGather(scene_path, receivers_path, tuning, progress));
    const GatherOptions filled = withDefaults(options);
    const std::uint64_t row_bytes = resultFloats(filled.outputs) * sizeof(float);
    SURFEIT_ASSIGN_OR_RETURN(const InputFile receivers, InputFile::open(receivers_path));
    GatherForecast forecast;
    forecast.receivers = report.receivers;
    forecast.sampled_receivers = report.sampled_receivers;
    forecast.threads = report.threads;
    forecast.memory_bytes = filled.memory_bytes;
    forecast.least_memory_bytes = report.rows.front().memory_bytes;
    forecast.recommended_memory_bytes = report.recommended.memory_bytes;
    forecast.temporary_bytes =
        report.receivers * (sizeof(SortedReceiver) + row_bytes + sizeof(std::uint32_t));
    forecast.result_bytes = receivers.size() + report.receivers * row_bytes;
    forecast.seconds = rowFor(report, filled.memory_bytes).predicted.seconds;
    return forecast;
  });
}

}  // namespace surfeit
