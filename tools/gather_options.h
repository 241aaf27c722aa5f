// Options that gathering and its tuning share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/bake.h"

namespace surfeit {

// An option that takes one of some words, of which the first is the default.
template <typename Value>
CLI::Option* addChoice(CLI::App& command, const std::string& name, Value& target,
                       const std::string& help,
                       const std::vector<std::pair<std::string, Value>>& choices) {
  std::string words;
  for (const auto& [word, value] : choices) words += (words.empty() ? "" : "|") + word;
  const auto choose = [=, &target](const std::string& found) {
    for (const auto& [word, value] : choices) {
      if (found != word) continue;
      target = value;
      return;
    }
    throw CLI::ValidationError(name, found + ", expected " + words);
  };
  return command.add_option_function<std::string>(name, choose, help)
      ->type_name(words)
      ->default_str(choices.front().first);
}

// Adds everything that says what is gathered and how pages are read: mode, channels of the
// receivers, quality, their order, caches. Parsing fills `options`, which must outlive `command`;
// threads and memory are left to the program's own options.
void addGatherOptions(CLI::App& command, GatherOptions& options);

// Parts of it, for commands that gather elsewhere: the mode, what decides about errors, and the
// caches.
void addModeOption(CLI::App& command, GatherMode& mode);
void addQualityOptions(CLI::App& command, GatherQuality& quality);
// --stage and --stage-limit. A directory "$NAME/..." begins with a variable of the environment of
// the process that gathers: jobs of a plan find the node's own.
void addStageOptions(CLI::App& command, GatherOptions& options);
// Puts the variable in. Errors: kInvalidArgument where it is not set.
Status expandStage(GatherOptions& options);
void addCacheOptions(CLI::App& command, double& cache_split, bool& direct_io);

// --subset, the groups of surfels that are seen, by numbers or by their names in `scene`: an
// argument of the command that was added before.
void addSubsetOption(CLI::App& command, std::uint64_t& groups, const std::string& scene);

// --gain, of the light that groups of surfels send, likewise.
void addGainOption(CLI::App& command, std::vector<GroupGain>& gains, const std::string& scene);

// "occlusion", "bleeding", "glossy"
const char* modeName(GatherMode mode);

}  // namespace surfeit
