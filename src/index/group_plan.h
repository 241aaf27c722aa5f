// Which object groups the inputs of the indexer get that have names.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "index/cloud_reader.h"
#include "surfeit/index.h"
#include "surfeit/status.h"

namespace surfeit {

// Inputs with names, and the groups that they get.
struct GroupPlan {
  std::vector<std::string> inputs;  // all of them
  CloudReader::Groups of_inputs;    // empty without names
  std::vector<std::string> names;   // of the groups from 1

  // For the provenance, as group_names.h reads it.
  nlohmann::json describe() const;
};

// The inputs, then those with names. kInvalidArgument for names that cannot be, or too many, or
// where the inputs are no files.
Result<GroupPlan> planGroups(const std::vector<std::string>& inputs,
                             const std::vector<NamedInput>& named, bool are_files);

}  // namespace surfeit
