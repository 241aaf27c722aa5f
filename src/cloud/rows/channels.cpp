#include "cloud/rows/channels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <unordered_map>
#include <utility>

#include "cloud/rows/srgb_curve.h"
#include "core/text_case.h"

namespace surfeit {
namespace {

constexpr std::string_view kColorSuffixes[3] = {"_r", "_g", "_b"};
constexpr std::string_view kVectorSuffixes[3] = {"_x", "_y", "_z"};
constexpr std::size_t kMaxNameChars = 56;  // leaves room for a suffix (cloud/ply/ply_format.h)
constexpr std::string_view kDropped = "-";

// A channel that we know, as rows have it.
struct KnownChannel {
  std::string_view name;
  ChannelKind kind;
  std::size_t components;
  std::string_view properties[3];  // empty: the name with a suffix
};

constexpr KnownChannel kKnownChannels[] = {
    {"position", ChannelKind::kPoint, 3, {"x", "y", "z"}},
    {"normal", ChannelKind::kNormal, 3, {"nx", "ny", "nz"}},
    {"color", ChannelKind::kColor, 3, {"red", "green", "blue"}},
    {"radius", ChannelKind::kFloat, 1, {}},
    {"width", ChannelKind::kFloat, 1, {}},
    {"area", ChannelKind::kFloat, 1, {}},
    {"occlusion", ChannelKind::kFloat, 1, {}},
    {"group", ChannelKind::kFloat, 1, {}},
    {"two_sided", ChannelKind::kFloat, 1, {}},
    {"id", ChannelKind::kFloat, 1, {}},
    {"alpha", ChannelKind::kFloat, 1, {}},
    {"intensity", ChannelKind::kFloat, 1, {}},
    {"density", ChannelKind::kFloat, 1, {}},
    {"opacity", ChannelKind::kFloat, 1, {}},
    {"radiosity", ChannelKind::kColor, 3, {}},
    {"albedo", ChannelKind::kColor, 3, {}},
    {"power", ChannelKind::kColor, 3, {}},
    {"irradiance", ChannelKind::kColor, 3, {}},
    {"environment", ChannelKind::kColor, 3, {}},
    {"indirectdiffuse", ChannelKind::kColor, 3, {}},
    {"incident", ChannelKind::kVector, 3, {}},
    {"view", ChannelKind::kVector, 3, {}},
    {"velocity", ChannelKind::kVector, 3, {}},
    {"bent_normal", ChannelKind::kVector, 3, {}},
    {"long_side", ChannelKind::kVector, 3, {}},
};

// What files call these channels, besides their own names.
struct Alias {
  std::string_view alias, name;
};
constexpr Alias kAliases[] = {
    // RenderMan, OpenVDB, Houdini, Blender, Krakatoa; those of RenderMan begin with an underscore
    {"P", "position"},
    {"N", "normal"},
    {"pscale", "radius"},
    {"radiusPP", "radius"},
    {"_radius", "radius"},
    {"widths", "width"},
    {"Cd", "color"},
    {"rgb", "color"},
    {"_color", "color"},
    {"Alpha", "alpha"},
    {"v", "velocity"},
    {"_area", "area"},
    {"_radiosity", "radiosity"},
    {"_albedo", "albedo"},
    {"_occlusion", "occlusion"},
    {"_indirectdiffuse", "indirectdiffuse"},
    {"_irradiance", "irradiance"},
    {"_power", "power"},
    {"_incident", "incident"},
    {"_environmentdir", "bent_normal"},
    {"light_group", "group"},
};

const KnownChannel* findKnown(std::string_view name) {
  for (const KnownChannel& channel : kKnownChannels) {
    if (channel.name == name) return &channel;
  }
  return nullptr;
}

bool hasComponents(const KnownChannel& known, std::size_t components) {
  return known.components == components ||
         (known.name == "color" && components == 4) ||  // with alpha
         (known.name == "opacity" && components == 3);  // of colors
}

// Opacities of three colors as RenderMan calls them; single values of these names are something
// else.
bool isOpacityOfColors(std::string_view name, std::size_t components) {
  return components == 3 && (name == "Oi" || name == "Os" || name == "_opacity");
}

// Our name of a file's channel: exact case first, then any.
std::string_view nameByTable(std::string_view name) {
  if (findKnown(name) != nullptr) return name;
  for (const Alias& row : kAliases) {
    if (row.alias == name) return row.name;
  }
  for (const KnownChannel& channel : kKnownChannels) {
    if (isSameInAnyCase(channel.name, name)) return channel.name;
  }
  for (const Alias& row : kAliases) {
    if (isSameInAnyCase(row.alias, name)) return row.name;
  }
  return name;
}

// The letters of a file made fit for a property.
std::string fitName(std::string_view name) {
  std::string fit(name.substr(0, kMaxNameChars));
  std::replace_if(
      fit.begin(), fit.end(), [](char c) { return !(c > ' ' && c < '\x7f'); }, '_');
  return fit.empty() ? "_" : fit;
}

// Whether integers of 8 or 16 bits code sRGB in this channel.
bool isColorOfSurfel(const RowChannel& channel) {
  return channel.properties.size() == 3 &&
         (channel.name == "color" || channel.name == "radiosity" || channel.name == "albedo");
}

// Finds what belongs together with a property.
class ChannelFinder {
 public:
  explicit ChannelFinder(const RowLayout& element)
      : element_(element), is_taken_(element.properties.size(), false) {
    // A hostile header may declare tens of thousands of properties
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      if (!element.properties[i].is_list) index_.emplace(element.properties[i].name, i);
    }
  }

  std::vector<RowChannel> find() {
    std::vector<RowChannel> channels;
    for (std::size_t i = 0; i < element_.properties.size(); ++i) {
      if (is_taken_[i] || element_.properties[i].is_list) continue;
      channels.push_back(channelFrom(i));
    }
    return channels;
  }

 private:
  using Names = std::array<std::string_view, 3>;

  RowChannel channelFrom(std::size_t first) {
    const std::string_view name = element_.properties[first].name;
    RowChannel channel;
    channel.name = name;
    for (const KnownChannel& known : kKnownChannels) {
      const auto& names = known.properties;
      if (names[0].empty() ||
          std::find(std::begin(names), std::end(names), name) == std::end(names)) {
        continue;
      }
      if (!take("", {names[0], names[1], names[2]}, channel)) break;
      channel.name = known.name;
      channel.kind = known.kind;
      return channel;
    }
    if (name.size() > 2) {
      const std::string_view base = name.substr(0, name.size() - 2);
      if (takeSuffixed(base, kColorSuffixes, ChannelKind::kColor, channel) ||
          takeSuffixed(base, kVectorSuffixes, ChannelKind::kVector, channel) ||
          takeNumbered(base, first, channel)) {
        return channel;
      }
    }
    add(first, channel);
    return channel;
  }

  bool takeSuffixed(std::string_view base, const std::string_view (&suffixes)[3], ChannelKind kind,
                    RowChannel& channel) {
    const bool ends_so = std::any_of(std::begin(suffixes), std::end(suffixes),
                                     [&](auto suffix) { return channel.name.ends_with(suffix); });
    if (!ends_so || !take(base, {suffixes[0], suffixes[1], suffixes[2]}, channel)) return false;
    channel.name = base;
    const KnownChannel* known = findKnown(base);
    channel.kind = known != nullptr && known->components == 3 ? known->kind : kind;
    return true;
  }

  // base_0, base_1, ... as they follow each other.
  bool takeNumbered(std::string_view base, std::size_t first, RowChannel& channel) {
    std::size_t end = first;
    for (; end < is_taken_.size(); ++end) {
      const RowProperty& property = element_.properties[end];
      if (is_taken_[end] || property.is_list ||
          property.name != fmt::format("{}_{}", base, end - first)) {
        break;
      }
    }
    if (end - first < 2) return false;
    for (std::size_t i = first; i < end; ++i) add(i, channel);
    channel.name = base;
    if (end - first == 16) channel.kind = ChannelKind::kMatrix;
    return true;
  }

  // Takes all three, in whatever order they stand, or none.
  bool take(std::string_view base, const Names& names, RowChannel& channel) {
    std::array<std::size_t, 3> found;
    for (std::size_t component = 0; component < 3; ++component) {
      const auto entry = index_.find(std::string(base) + std::string(names[component]));
      if (entry == index_.end() || is_taken_[entry->second]) return false;
      found[component] = entry->second;
    }
    for (const std::size_t i : found) add(i, channel);
    return true;
  }

  void add(std::size_t property, RowChannel& channel) {
    const ValueType type = element_.properties[property].type;
    channel.type = channel.properties.empty() ? type : widestType(channel.type, type);
    channel.properties.push_back(property);
    is_taken_[property] = true;
  }

  const RowLayout& element_;
  std::unordered_map<std::string, std::size_t> index_;  // of the scalars, by name
  std::vector<bool> is_taken_;
};

}  // namespace

Result<std::vector<ChannelRename>> parseChannelRenames(std::string_view text) {
  std::vector<ChannelRename> renames;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    const std::string_view part = text.substr(0, end);
    const std::size_t equals = part.find('=');
    if (equals == std::string_view::npos || equals == 0 || equals + 1 == part.size() ||
        (end < text.size() && end + 1 == text.size())) {
      return Status::invalidArgument(
          fmt::format("channels: found {}, expected FROM=TO,FROM=TO", quoteText(part)));
    }
    const std::string_view to = part.substr(equals + 1);
    if (to != fitName(to)) {
      return Status::invalidArgument(
          fmt::format("channels: found {}, expected a name of at most {} characters without blanks",
                      quoteText(to), kMaxNameChars));
    }
    renames.push_back({std::string(part.substr(0, equals)), std::string(to)});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return renames;
}

bool isKnownChannel(std::string_view name) { return findKnown(name) != nullptr; }

std::vector<std::string> propertyNames(std::string_view name, std::size_t components,
                                       ChannelKind kind, std::span<const ChannelRename> renames) {
  // Our name
  const auto rename = std::find_if(renames.begin(), renames.end(),
                                   [&](const ChannelRename& r) { return r.from == name; });
  const bool is_renamed = rename != renames.end();
  if (components == 0 || (is_renamed && rename->to == kDropped)) return {};
  std::string ours = fitName(is_renamed ? rename->to : nameByTable(name));
  const KnownChannel* known = findKnown(ours);
  if (known != nullptr && !hasComponents(*known, components)) {
    known = nullptr;
    if (!is_renamed) ours = fitName(name);  // a single v is no velocity
  }
  if (!is_renamed && isOpacityOfColors(name, components)) known = findKnown(ours = "opacity");

  // What we know has its own names
  if (known != nullptr && !known->properties[0].empty()) {
    std::vector<std::string> names(std::begin(known->properties), std::end(known->properties));
    if (components == 4) names.emplace_back("alpha");
    return names;
  }

  // Others by their letters
  std::vector<std::string> names;
  if (components == 1) return {ours};
  if (known != nullptr) kind = known->components == 1 ? ChannelKind::kColor : known->kind;
  const auto& suffixes = kind == ChannelKind::kColor ? kColorSuffixes : kVectorSuffixes;
  for (std::size_t i = 0; i < components; ++i) {
    names.push_back(components == 3 ? ours + std::string(suffixes[i])
                                    : fmt::format("{}_{}", ours, i));
  }
  return names;
}

Status addChannel(std::string_view name, std::size_t components, ChannelKind kind, ValueType type,
                  std::span<const ChannelRename> renames, const std::string& path,
                  RowLayout& element) {
  for (std::string& property_name : propertyNames(name, components, kind, renames)) {
    if (element.find(property_name) != nullptr) {
      return Status::corruption(fmt::format(
          "{}: channel {}: found a second property {}, expected another name (--channels {}=NAME "
          "gives it one, {}=- drops it)",
          path, quoteText(name), property_name, fitName(name), fitName(name)));
    }
    RowProperty property;
    property.name = std::move(property_name);
    if (property.name != name) property.typed = name;
    property.type = type;
    property.offset = element.row_bytes;
    element.row_bytes += valueTypeBytes(type);
    element.properties.push_back(std::move(property));
  }
  return {};
}

std::vector<std::string> typedNames(const RowLayout& element, std::string_view name) {
  std::vector<std::string> names = {std::string(name)};
  const KnownChannel* const known = findKnown(name);
  if (known != nullptr && known->components == 3) names = propertyNames(name, 3, known->kind, {});
  std::vector<std::string> typed;
  bool is_otherwise = false;
  for (const std::string& each : names) {
    const RowProperty* const property = element.find(each);
    if (property == nullptr) continue;
    is_otherwise = is_otherwise || !property->typed.empty();
    const std::string& word = property->typed.empty() ? each : property->typed;
    if (std::find(typed.begin(), typed.end(), word) == typed.end()) typed.push_back(word);
  }
  return is_otherwise ? typed : std::vector{std::string(name)};
}

namespace {

// Whether properties of that name, or of a channel's, are made of others.
bool isMade(const RowLayout& element, std::string_view name) {
  std::vector<std::string> names = {std::string(name)};
  const KnownChannel* const known = findKnown(name);
  if (known != nullptr && known->components == 3) names = propertyNames(name, 3, known->kind, {});
  return std::any_of(names.begin(), names.end(), [&](const std::string& each) {
    const RowProperty* const property = element.find(each);
    return property != nullptr && property->is_made;
  });
}

}  // namespace

std::string renamingOf(const RowLayout& element, std::string_view name, std::string_view to) {
  if (isMade(element, name)) return {};
  const std::vector<std::string> typed = typedNames(element, name);
  if (typed.size() != 3) return fmt::format("{}={}", typed.front(), to);
  const std::vector<std::string> names = propertyNames(to, 3, ChannelKind::kColor, {});
  return fmt::format("{}={},{}={},{}={}", typed[0], names[0], typed[1], names[1], typed[2],
                     names[2]);
}

std::string dropsOf(const RowLayout& element, std::string_view name) {
  std::string drops;
  if (isMade(element, name)) return drops;
  for (const std::string& typed : typedNames(element, name)) {
    drops += fmt::format("{}{}=-", drops.empty() ? "" : ",", typed);
  }
  return drops;
}

std::vector<RowChannel> channelsOf(const RowLayout& element) {
  return ChannelFinder(element).find();
}

bool isCodedColor(const RowChannel& channel) {
  return isColorOfSurfel(channel) && codesSrgb(channel.type);
}

double channelValue(const RowLayout& element, const RowChannel& channel, std::size_t component,
                    const std::byte* row) {
  const RowProperty& property = element.properties[channel.properties[component]];
  const double value = rowValue(row + property.offset, property.type);
  if (isColorOfSurfel(channel) && codesSrgb(property.type)) {
    return linearFromSrgbCode(value / (property.type == ValueType::kUint8 ? 255 : 65535));
  }
  return value;
}

}  // namespace surfeit
