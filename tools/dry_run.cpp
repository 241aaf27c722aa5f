#include "tools/dry_run.h"

#include <fmt/format.h>

namespace surfeit {

void addDryRunOption(CLI::App& command, bool& is_dry_run) {
  command.add_flag("--dry-run", is_dry_run,
                   "Write nothing; estimate files and time from a sample of 65,536 records");
}

Status sayForecast(const std::string& command, const std::vector<std::string>& inputs,
                   const std::string& output, const ReadOptions& reading,
                   const std::string& temporary_directory, const SampleJob& job,
                   CommandContext& context) {
  SURFEIT_ASSIGN_OR_RETURN(
      const SampleForecast forecast,
      forecastBySample(inputs, output, reading, temporary_directory, job, context.progress()));
  context.answer(
      fmt::format("{}: {} records in {} to read, by a sample of {}:\n"
                  "  temporary files  about {}\n"
                  "  output           about {}\n"
                  "  time             about {:.1f} s, and that to read the input\n"
                  "Nothing was written.",
                  output, formatCount(forecast.records), formatBytes(forecast.input_bytes),
                  formatCount(forecast.sampled_records), formatBytes(forecast.temporary_bytes),
                  formatBytes(forecast.output_bytes), forecast.seconds));
  return context.writeStats({{"command", command},
                             {"dry_run", true},
                             {"records", forecast.records},
                             {"sampled_records", forecast.sampled_records},
                             {"input_bytes", forecast.input_bytes},
                             {"temporary_bytes", forecast.temporary_bytes},
                             {"output_bytes", forecast.output_bytes},
                             {"seconds", forecast.seconds}});
}

}  // namespace surfeit
