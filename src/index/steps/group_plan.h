// Which object groups the inputs of the indexer get that have names.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "index/steps/cloud_reader.h"
#include "surfeit/index.h"
#include "surfeit/status.h"

namespace surfeit {

// Inputs with names, and the groups that they get.
struct GroupPlan {
  std::vector<std::string> inputs;  // all of them
  CloudReader::Groups of_inputs;    // empty without names
  std::vector<std::string> names;   // of the groups from 1
};

// Names by group.
using GroupNames = std::map<std::uint32_t, std::string>;

// Those of the plan, then those that clouds say. Where two are at odds the former is right, which
// `notes` then tell.
GroupNames groupNames(const GroupPlan& plan, const CloudReader& reader,
                      std::vector<std::string>& notes);

// The inputs, then those with names. kInvalidArgument for names that cannot be, or too many, or
// where the inputs are no files.
Result<GroupPlan> planGroups(const std::vector<std::string>& inputs,
                             const std::vector<NamedInput>& named, bool are_files);

}  // namespace surfeit
