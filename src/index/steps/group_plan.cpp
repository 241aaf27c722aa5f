#include "index/steps/group_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "surfeit/group_names.h"
#include "surfeit/surfel.h"

namespace surfeit {

GroupNames groupNames(const GroupPlan& plan, const CloudReader& reader,
                      std::vector<std::string>& notes) {
  GroupNames names;
  for (std::size_t i = 0; i < plan.names.size(); ++i) {
    names[static_cast<std::uint32_t>(i + 1)] = plan.names[i];
  }
  for (const auto& stated : reader.groupNames(notes)) {
    // A name that two groups have would choose one of them
    const auto taken = std::find_if(names.begin(), names.end(), [&](const auto& known) {
      return known.first == stated.first || known.second == stated.second;
    });
    if (taken == names.end()) {
      names.insert(stated);
    } else if (*taken != stated) {
      notes.push_back(
          fmt::format("group {} of the clouds is \"{}\", but group {} is \"{}\", which stays: "
                      "index --group gives all clouds names",
                      stated.first, stated.second, taken->first, taken->second));
    }
  }
  return names;
}

Result<GroupPlan> planGroups(const std::vector<std::string>& inputs,
                             const std::vector<NamedInput>& named, bool are_files) {
  GroupPlan plan{inputs, {}, {}};
  if (named.empty()) return plan;
  if (!are_files) {
    return Status::invalidArgument(
        "inputs with names are files, found surfels from memory beside them");
  }
  plan.of_inputs.resize(inputs.size());
  for (const NamedInput& input : named) {
    SURFEIT_RETURN_IF_ERROR(checkGroupName(input.name));
    auto place = std::find(plan.names.begin(), plan.names.end(), input.name);
    if (place == plan.names.end()) place = plan.names.insert(place, input.name);
    const std::size_t group = static_cast<std::size_t>(place - plan.names.begin()) + 1;
    if (group >= kMaxGroups) {
      return Status::invalidArgument(
          fmt::format("{} names of groups, expected at most {}", group, kMaxGroups - 1));
    }
    plan.inputs.push_back(input.path);
    plan.of_inputs.emplace_back(static_cast<std::uint8_t>(group));
  }
  return plan;
}

}  // namespace surfeit
