#include "index/group_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "surfeit/group_names.h"
#include "surfeit/surfel.h"

namespace surfeit {

nlohmann::json GroupPlan::describe() const {
  nlohmann::json json = nlohmann::json::object();
  for (std::size_t i = 0; i < names.size(); ++i) json[std::to_string(i + 1)] = names[i];
  return json;
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
