// --dry-run of commands from clouds to a cloud.
#pragma once

#include <string>
#include <vector>

#include "surfeit/forecast.h"
#include "tools/command.h"

namespace surfeit {

void addDryRunOption(CLI::App& command, bool& is_dry_run);

// Does `job` with a sample of the inputs and says what all of it needs.
Status sayForecast(const std::string& command, const std::vector<std::string>& inputs,
                   const std::string& output, const ReadOptions& reading,
                   const std::string& temporary_directory, const SampleJob& job,
                   CommandContext& context);

}  // namespace surfeit
