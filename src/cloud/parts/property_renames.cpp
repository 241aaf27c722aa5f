#include "cloud/parts/property_renames.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>
#include <utility>

#include "cloud/rows/property_aliases.h"

namespace surfeit {
namespace {

const std::string kColor = "color";
constexpr std::size_t kTwinNameChars = 48;  // what tells twins apart is kept

}  // namespace

std::vector<RowProperty> renamedProperties(const RowLayout& element,
                                           std::span<const ChannelRename> renames) {
  const auto is_renamed = [renames](std::string_view name) {
    return std::any_of(renames.begin(), renames.end(),
                       [&](const ChannelRename& rename) { return rename.from == name; });
  };

  // As we call them, but for properties that the user calls otherwise
  RowLayout known = element;
  for (RowProperty& property : known.properties) {
    if (is_renamed(property.name)) property.is_list = true;  // out of sight
  }
  const std::vector<std::string> known_names = knownNames(known);
  known.properties = element.properties;
  for (std::size_t i = 0; i < known_names.size(); ++i) known.properties[i].name = known_names[i];

  // Whole channels, by our name or the file's, then single properties
  std::vector<RowProperty> renamed = element.properties;
  for (RowProperty& property : renamed) property.name.clear();
  const auto rename = [&](const RowChannel& channel, const std::string& from) {
    const std::vector<std::string> given =
        propertyNames(from, channel.properties.size(), channel.kind, renames);
    for (std::size_t i = 0; i < given.size(); ++i) {
      RowProperty& property = renamed[channel.properties[i]];
      property.name = given[i];
      property.typed = from;
    }
  };
  std::vector<bool> is_done(element.properties.size(), false);
  for (const RowLayout& names_of : {std::cref(element), std::cref(std::as_const(known))}) {
    for (const RowChannel& channel : channelsOf(names_of)) {
      // A color packed into one number is a color, too
      const bool is_packed = channel.name == "rgb" || channel.name == "rgba";
      const std::string& from = is_packed && !is_renamed(channel.name) ? kColor : channel.name;
      const bool is_any_done = std::any_of(channel.properties.begin(), channel.properties.end(),
                                           [&](std::size_t i) -> bool { return is_done[i]; });
      if (!is_renamed(from) || is_any_done) continue;
      rename(channel, from);
      for (const std::size_t i : channel.properties) is_done[i] = true;
    }
  }
  for (std::size_t i = 0; i < renamed.size(); ++i) {
    if (is_done[i] || element.properties[i].is_list) continue;
    const std::string& from = known.properties[i].name;
    renamed[i].name = from;
    if (!is_renamed(from)) continue;
    const std::vector<std::string> given = propertyNames(from, 1, ChannelKind::kFloat, renames);
    renamed[i].name = given.empty() ? "" : given.front();
    renamed[i].typed = from;
  }
  return renamed;
}

Result<RowLayout> renamedElement(const RowLayout& original, std::span<const ChannelRename> renames,
                                 const std::string& path) {
  std::vector<RowProperty> renamed = renamedProperties(original, renames);
  RowLayout element = original;
  element.properties.clear();
  std::set<std::string> taken;
  for (std::size_t i = 0; i < renamed.size(); ++i) {
    if (renamed[i].name.empty()) continue;
    if (!taken.insert(renamed[i].name).second) {
      return Status::corruption(
          fmt::format("{}: element {}: property {} would be a second {}, expected another name",
                      path, original.name, original.properties[i].name, renamed[i].name));
    }
    element.properties.push_back(std::move(renamed[i]));
  }
  return element;
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
