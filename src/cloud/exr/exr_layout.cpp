#include "cloud/exr/exr_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

namespace surfeit {
namespace {

// Channels that are three values of one thing.
struct TripleSuffix {
  std::array<std::string_view, 3> suffixes;
  ChannelKind kind;
};
constexpr TripleSuffix kTripleSuffixes[] = {
    {{"R", "G", "B"}, ChannelKind::kColor},
    {{"r", "g", "b"}, ChannelKind::kColor},
    {{"X", "Y", "Z"}, ChannelKind::kVector},
    {{"x", "y", "z"}, ChannelKind::kVector},
};

// What --channels calls R, G and B without a layer.
constexpr std::string_view kBareColor = "RGB";

const std::vector<std::string> kPositionNames = {"x", "y", "z"};
const std::vector<std::string> kNormalNames = {"nx", "ny", "nz"};

std::pair<std::string_view, std::string_view> splitAtLastDot(std::string_view name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos) return {"", name};
  return {name.substr(0, dot), name.substr(dot + 1)};
}

std::string join(std::string_view layer, std::string_view suffix) {
  return layer.empty() ? std::string(suffix) : fmt::format("{}.{}", layer, suffix);
}

// A channel, or three that belong together.
struct Group {
  std::string name;
  std::vector<std::size_t> sources;
  ChannelKind kind = ChannelKind::kFloat;
  std::vector<std::string> properties;  // empty: dropped
};

std::string tripleName(std::string_view layer, const TripleSuffix& triple) {
  if (!layer.empty()) return std::string(layer);
  return fmt::format("{}{}{}", triple.suffixes[0], triple.suffixes[1], triple.suffixes[2]);
}

std::vector<Group> groupSources(std::span<const ExrSource> sources) {
  std::unordered_map<std::string_view, std::size_t> by_name;
  for (std::size_t i = 0; i < sources.size(); ++i) by_name.emplace(sources[i].name, i);
  std::vector<bool> is_taken(sources.size(), false);
  std::vector<Group> groups;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (is_taken[i]) continue;
    const auto [layer, suffix] = splitAtLastDot(sources[i].name);
    Group group = {sources[i].name, {i}, ChannelKind::kFloat, {}};
    for (const TripleSuffix& triple : kTripleSuffixes) {
      if (std::find(triple.suffixes.begin(), triple.suffixes.end(), suffix) ==
          triple.suffixes.end()) {
        continue;
      }
      std::vector<std::size_t> found;
      for (const std::string_view s : triple.suffixes) {
        const auto entry = by_name.find(join(layer, s));
        if (entry != by_name.end() && !is_taken[entry->second]) found.push_back(entry->second);
      }
      if (found.size() == 3) group = {tripleName(layer, triple), found, triple.kind, {}};
    }
    for (const std::size_t source : group.sources) is_taken[source] = true;
    groups.push_back(std::move(group));
  }
  return groups;
}

bool isRenamed(std::string_view name, std::span<const ChannelRename> renames) {
  return std::any_of(renames.begin(), renames.end(),
                     [&](const ChannelRename& rename) { return rename.from == name; });
}

// Renames first; then positions and normals also by the last part of their name, since renderers
// put the name of a scene or of a view in front.
std::vector<std::string> groupProperties(const Group& group,
                                         std::span<const ChannelRename> renames) {
  const std::size_t components = group.sources.size();
  const std::string_view last = splitAtLastDot(group.name).second;
  if (isRenamed(group.name, renames)) {
    return propertyNames(group.name, components, group.kind, renames);
  }
  std::vector<std::string> of_last = propertyNames(last, components, group.kind, renames);
  if (isRenamed(last, renames) || of_last == kPositionNames || of_last == kNormalNames) {
    return of_last;
  }
  if (group.name == kBareColor) return propertyNames("color", components, group.kind, renames);
  return propertyNames(group.name, components, group.kind, renames);
}

// The first group that holds one value and whose name passes `test`.
template <typename Test>
Group* findSingle(std::vector<Group>& groups, const Test& test) {
  for (Group& group : groups) {
    if (group.sources.size() == 1 && test(group.name)) return &group;
  }
  return nullptr;
}

Group* findAlpha(std::vector<Group>& groups) {
  Group* alpha = findSingle(groups, [](const std::string& name) { return name == "A"; });
  const auto isMain = [](const std::string& name) {
    const auto [layer, suffix] = splitAtLastDot(name);
    const std::string_view last = splitAtLastDot(layer).second;
    return suffix == "A" && (last == "Combined" || last == "rgba" || last == "RGBA");
  };
  return alpha != nullptr ? alpha : findSingle(groups, isMain);
}

Group* findDepth(std::vector<Group>& groups) {
  Group* depth = findSingle(groups, [](const std::string& name) { return name == "Z"; });
  const auto isDepth = [](const std::string& name) {
    const std::string_view last = splitAtLastDot(name).second;
    return last == "Z" || last == "depth" || last == "Depth";
  };
  return depth != nullptr ? depth : findSingle(groups, isDepth);
}

std::vector<Group> namedGroups(std::span<const ExrSource> sources,
                               std::span<const ChannelRename> renames) {
  std::vector<Group> groups = groupSources(sources);
  for (Group& group : groups) group.properties = groupProperties(group, renames);
  // What the user names comes before what tables name
  std::stable_partition(groups.begin(), groups.end(), [&](const Group& group) {
    return isRenamed(group.name, renames) || isRenamed(splitAtLastDot(group.name).second, renames);
  });
  return groups;
}

// Adds columns and properties one after the other.
class LayoutBuilder {
 public:
  LayoutBuilder(std::span<const ExrSource> sources, ExrLayout& layout)
      : sources_(sources), layout_(layout) {}

  void addProperty(const std::string& name, ValueType type, const std::string& group = {}) {
    RowLayout& element = layout_.element;
    RowProperty property;
    property.name = name;
    if (name != group) property.typed = group;
    property.type = type;
    property.offset = element.row_bytes;
    element.row_bytes += valueTypeBytes(type);
    element.properties.push_back(std::move(property));
  }

  // The index of the first column. Floats unless `keeps_integers`.
  std::size_t addColumns(const Group& group, bool keeps_integers) {
    const std::size_t first = layout_.columns.size();
    for (std::size_t i = 0; i < group.sources.size(); ++i) {
      const bool is_integer = keeps_integers && sources_[group.sources[i]].is_integer;
      ExrColumn column = {group.sources[i], is_integer, std::nullopt};
      if (!group.properties.empty()) {
        column.property = layout_.element.properties.size();
        addProperty(group.properties[i], is_integer ? ValueType::kUint32 : ValueType::kFloat32,
                    group.name);
      }
      layout_.columns.push_back(column);
    }
    return first;
  }

  std::array<std::size_t, 3> addTriple(const Group& group) {
    const std::size_t first = addColumns(group, false);
    return {first, first + 1, first + 2};
  }

  bool isTaken(const Group& group) const {
    return std::any_of(
        group.properties.begin(), group.properties.end(),
        [&](const std::string& name) { return layout_.element.find(name) != nullptr; });
  }

 private:
  std::span<const ExrSource> sources_;
  ExrLayout& layout_;
};

// The layer of three values that may be a position, by its name or as the only one.
std::string likeliestPosition(std::span<const ExrSource> sources) {
  std::vector<std::string> layers;
  for (const Group& group : groupSources(sources)) {
    if (group.sources.size() != 3) continue;
    std::string lower = group.name;
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const std::string_view last = splitAtLastDot(lower).second;
    if (lower.find("pos") != lower.npos || last.starts_with('p')) return group.name;
    layers.push_back(group.name);
  }
  return layers.size() == 1 && layers[0] != "N" ? layers[0] : "NAME";
}

Status noPosition(std::span<const ExrSource> sources, const std::string& path) {
  constexpr std::size_t kMaxListed = 200;
  std::string found;
  for (const ExrSource& source : sources) {
    if (found.size() > kMaxListed) break;
    found += (found.empty() ? "" : " ") + source.name;
  }
  return Status::corruption(fmt::format(
      "{}: found the channels {}, expected world positions: P.X P.Y P.Z, or others that "
      "--channels {}=position names{}",
      path, found.empty() ? "none" : quoteText(found), likeliestPosition(sources),
      found == "Z" || found.ends_with(" Z") ? "; a depth alone is none" : ""));
}

}  // namespace

std::string exrLayerName(const std::string& channel, const std::string& part, bool is_first_part,
                         std::span<const ChannelRename> renames) {
  if (part.empty() || channel.find('.') != std::string::npos) return channel;
  const std::vector<std::string> names = propertyNames(part, 3, ChannelKind::kVector, renames);
  if (is_first_part && names != kPositionNames && names != kNormalNames) return channel;
  return join(part, channel);
}

bool hasExrPosition(std::span<const ExrSource> sources, std::span<const ChannelRename> renames) {
  const std::vector<Group> groups = namedGroups(sources, renames);
  return std::any_of(groups.begin(), groups.end(),
                     [](const Group& group) { return group.properties == kPositionNames; });
}

Result<ExrLayout> layOutExr(std::span<const ExrSource> sources,
                            std::span<const ChannelRename> renames, const std::string& main_layer,
                            const std::string& path) {
  std::vector<Group> groups = namedGroups(sources, renames);
  ExrLayout layout;
  layout.element.name = "vertex";
  LayoutBuilder builder(sources, layout);

  const auto findNamed = [&](const std::vector<std::string>& names) {
    return std::find_if(groups.begin(), groups.end(),
                        [&](const Group& group) { return group.properties == names; });
  };
  const auto position = findNamed(kPositionNames);
  if (position == groups.end()) return noPosition(sources, path);
  layout.position = builder.addTriple(*position);
  layout.is_position_half = std::any_of(
      layout.position.begin(), layout.position.end(),
      [&](std::size_t column) { return sources[layout.columns[column].source].is_half; });
  const auto normal = findNamed(kNormalNames);
  if (normal != groups.end()) layout.normal = builder.addTriple(*normal);
  layout.pixel = layout.element.properties.size();
  builder.addProperty("pixel_x", ValueType::kInt32);
  builder.addProperty("pixel_y", ValueType::kInt32);

  // The mask's channels are kept as well, unless --channels drops them
  Group* const alpha = findAlpha(groups);
  Group* const depth = findDepth(groups);
  const auto nameMask = [&](Group* group, const char* name) {
    if (group != nullptr && !isRenamed(group->name, renames)) group->properties = {name};
  };
  nameMask(alpha, "alpha");
  nameMask(depth, "depth");

  const bool has_main_layer = std::any_of(groups.begin(), groups.end(),
                                          [&](const Group& g) { return g.name == main_layer; });
  for (Group& group : groups) {
    if (&group == &*position || (normal != groups.end() && &group == &*normal)) continue;
    if (has_main_layer && group.name == kBareColor) continue;
    const bool is_mask = &group == alpha || &group == depth;
    if (builder.isTaken(group)) {
      layout.notes.push_back(fmt::format("channel {} is not read: {} is there already", group.name,
                                         group.properties.front()));
      group.properties.clear();
    }
    if (group.properties.empty() && !is_mask) continue;
    const std::size_t column = builder.addColumns(group, !is_mask);
    if (&group == alpha) layout.alpha = column;
    if (&group == depth) layout.depth = column;
  }
  return layout;
}

}  // namespace surfeit
