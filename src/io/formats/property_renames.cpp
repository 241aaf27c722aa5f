#include "io/formats/property_renames.h"

#include <fmt/format.h>

#include <algorithm>

namespace surfeit {
namespace {

constexpr std::size_t kTwinNameChars = 48;  // what tells twins apart is kept

}  // namespace

std::vector<std::string> renamedProperties(const PlyElement& element,
                                           std::span<const ChannelRename> renames) {
  const auto is_renamed = [renames](std::string_view name) {
    return std::any_of(renames.begin(), renames.end(),
                       [&](const ChannelRename& rename) { return rename.from == name; });
  };
  std::vector<std::string> names(element.properties.size());
  for (const RowChannel& channel : channelsOf(element)) {
    const std::vector<std::size_t>& properties = channel.properties;
    if (is_renamed(channel.name)) {
      const std::vector<std::string> given =
          propertyNames(channel.name, properties.size(), channel.kind, renames);
      for (std::size_t i = 0; i < given.size(); ++i) names[properties[i]] = given[i];
      continue;
    }
    for (const std::size_t i : properties) {
      names[i] = element.properties[i].name;
      if (!is_renamed(names[i])) continue;
      const std::vector<std::string> given =
          propertyNames(names[i], 1, ChannelKind::kFloat, renames);
      names[i] = given.empty() ? "" : given.front();
    }
  }
  return names;
}

std::string DistinctNames::add(const std::string& name) {
  std::string distinct = name;
  if (taken_.contains(distinct)) {
    // Numbers that were taken once stay taken, so the search goes on where it ended
    const std::string stem = name.substr(0, kTwinNameChars);
    std::uint64_t& twin = next_twin_.try_emplace(stem, 2).first->second;
    do {
      distinct = fmt::format("{}_{}", stem, twin++);
    } while (taken_.contains(distinct));
  }
  taken_.insert(distinct);
  return distinct;
}

}  // namespace surfeit
