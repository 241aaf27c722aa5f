#include "tools/dry_run.h"

#include <fmt/format.h>

namespace surfeit {

void addDryRunOption(CLI::App& command, bool& is_dry_run) {
  command.add_flag("--dry-run", is_dry_run,
                   "Write nothing; estimate memory, files and time from a sample");
}

Status sayForecast(const std::string& command, const std::string& records,
                   const std::string& output, const SampleForecast& forecast,
                   CommandContext& context) {
  context.answer(fmt::format(
      "{}: {} {}, {} to read, by a sample of {}:\n"
      "  memory           at most {}\n"
      "  temporary files  about {}\n"
      "  output           about {}\n"
      "  time             about {:.1f} s\n"
      "Nothing was written.",
      output, formatCount(forecast.records), records, formatBytes(forecast.input_bytes),
      formatCount(forecast.sampled_records), formatBytes(forecast.memory_bytes),
      formatBytes(forecast.temporary_bytes), formatBytes(forecast.output_bytes), forecast.seconds));
  return context.writeStats({{"command", command},
                             {"dry_run", true},
                             {"records", forecast.records},
                             {"sampled_records", forecast.sampled_records},
                             {"input_bytes", forecast.input_bytes},
                             {"memory_bytes", forecast.memory_bytes},
                             {"temporary_bytes", forecast.temporary_bytes},
                             {"output_bytes", forecast.output_bytes},
                             {"seconds", forecast.seconds}});
}

}  // namespace surfeit
