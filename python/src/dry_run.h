// dry_run of jobs from clouds to a cloud (surfeit/forecast.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "call.h"
#include "records.h"
#include "surfeit/forecast.h"

namespace surfeit::python {

// Estimates a job from a sample of the inputs. `run(samples, output, options, progress)` does the
// job and returns a Result of its statistics.
template <typename Options, typename Run>
py::dict dryRun(const std::vector<std::string>& inputs, const std::string& output,
                const Options& options, const py::object& watcher, const Run& run) {
  Options sampled = options;
  static_cast<ReadOptions&>(sampled) = {};  // the samples are read by these already
  std::uint64_t memory_bytes = 0;
  const SampleJob job = [&](const auto& samples, const std::string& result,
                            Progress& progress) -> Result<std::uint64_t> {
    const auto stats = run(samples, result, sampled, progress);
    if (!stats.ok()) return stats.status();
    memory_bytes = stats->memory_bytes;
    return std::uint64_t(stats->temporary_bytes);
  };
  SampleForecast forecast = runFor<SampleForecast>(watcher, [&](Progress& progress) {
    return forecastBySample(inputs, output, options, options.temporary_directory, job, progress);
  });
  forecast.memory_bytes = memory_bytes;
  return record(forecast);
}

}  // namespace surfeit::python
