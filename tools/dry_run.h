// --dry-run of the commands.
#pragma once

#include <string>
#include <vector>

#include "surfeit/forecast.h"
#include "tools/command.h"

namespace surfeit {

void addDryRunOption(CLI::App& command, bool& is_dry_run);

// Says what a job needs by its forecast; `records` is what it counts: "points".
Status sayForecast(const std::string& command, const std::string& records,
                   const std::string& output, const SampleForecast& forecast,
                   CommandContext& context);

// What all of a job needs, by run(samples, result, options, progress): its statistics have
// memory_bytes and temporary_bytes.
template <typename Options, typename Run>
Result<SampleForecast> forecastOf(const std::vector<std::string>& inputs, const std::string& output,
                                  const Options& options, const Run& run, CommandContext& context) {
  Options sampled = options;
  static_cast<ReadOptions&>(sampled) = {};  // samples are read as they were written
  std::uint64_t memory_bytes = 0;
  const SampleJob job = [&](const auto& samples, const std::string& result,
                            Progress& progress) -> Result<std::uint64_t> {
    SURFEIT_ASSIGN_OR_RETURN(const auto stats, run(samples, result, sampled, progress));
    memory_bytes = stats.memory_bytes;
    return stats.temporary_bytes;
  };
  SURFEIT_ASSIGN_OR_RETURN(SampleForecast forecast,
                           forecastBySample(inputs, output, options, options.temporary_directory,
                                            job, context.progress()));
  forecast.memory_bytes = memory_bytes;
  return forecast;
}

}  // namespace surfeit
