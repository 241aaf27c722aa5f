// Options for the look of bounce light, of `surfeit gather` and `surfeit bounce`.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "surfeit/bounce.h"
#include "surfeit/bounce_look.h"
#include "surfeit/status.h"

namespace surfeit {

// Adds --bounce-gain, --bounce-saturation, --bounce-tint and --bounce-filter. Parsing fills `look`,
// which must outlive `command`.
void addLookOptions(CLI::App& command, BounceLook& look);

// What addGroupLookOptions parses into: "NAME=VALUE" as given.
struct GroupLookArguments {
  std::vector<std::string> gains, saturations, tints, glossy;

  // By the names that the scene has for its groups. kInvalidArgument names the option, what was
  // found and what is expected.
  Result<std::vector<GroupCorrection>> corrections(const std::string& scene) const;
  Result<std::vector<GroupGloss>> gloss(const std::string& scene) const;
};

// Adds --group-gain, --group-saturation, --group-tint and --glossy.
void addGroupLookOptions(CLI::App& command, GroupLookArguments& arguments);

}  // namespace surfeit
