#include "view/channel.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "cloud/rows/channels.h"
#include "view/srgb.h"

namespace surfeit {
namespace {

// Names that are not spelled NAME_r NAME_g NAME_b.
struct NamedTriple {
  std::string_view name;
  std::array<std::string_view, 3> properties;
};
constexpr NamedTriple kNamedTriples[] = {
    {"color", {"red", "green", "blue"}},
    {"normal", {"nx", "ny", "nz"}},
    {"position", {"x", "y", "z"}},
};

constexpr std::array<std::string_view, 3> kColorSuffixes = {"_r", "_g", "_b"};
constexpr std::array<std::string_view, 3> kVectorSuffixes = {"_x", "_y", "_z"};

// What turns an integer color into a display value; 0 for floats, which are linear already.
float displayScale(ValueType type) {
  switch (type) {
    case ValueType::kUint8:
      return 1 / 255.f;
    case ValueType::kUint16:
      return 1 / 65535.f;
    default:
      return 0;
  }
}

// Whether a property is one of three that code a color; other integers are numbers.
bool isCode(const RowLayout& element, std::string_view name) {
  for (const RowChannel& channel : channelsOf(element)) {
    if (!isCodedColor(channel)) continue;
    for (const std::size_t i : channel.properties) {
      if (element.properties[i].name == name) return true;
    }
  }
  return false;
}

bool findFields(const RowLayout& element, const std::array<std::string, 3>& names,
                std::array<RowField, 3>& fields) {
  for (std::size_t i = 0; i < 3; ++i) fields[i] = RowField::find(element, names[i]);
  return fields[0].exists() && fields[1].exists() && fields[2].exists();
}

}  // namespace

glm::vec3 Channel::Triple::read(const std::byte* row) const {
  if (!exists()) return glm::vec3(constant);
  const glm::vec3 value(float(fields[0].read(row)), float(fields[1].read(row)),
                        float(fields[2].read(row)));
  return display_scale > 0 ? linearFromSrgb(value * display_scale) : value;
}

Channel::Triple Channel::findTriple(const RowLayout& element, const std::string& name) {
  Triple triple;
  for (const NamedTriple& named : kNamedTriples) {
    if (named.name != name) continue;
    const auto& p = named.properties;
    if (!findFields(element, {std::string(p[0]), std::string(p[1]), std::string(p[2])},
                    triple.fields)) {
      return {};
    }
    if (name == "color") triple.display_scale = displayScale(triple.fields[0].type);
    return triple;
  }
  for (const auto& suffixes : {kColorSuffixes, kVectorSuffixes}) {
    std::array<std::string, 3> names;
    for (std::size_t i = 0; i < 3; ++i) names[i] = name + std::string(suffixes[i]);
    if (findFields(element, names, triple.fields)) {
      triple.display_scale = displayScale(triple.fields[0].type);
      return triple;
    }
  }
  return {};
}

Result<Channel> Channel::find(const RowLayout& element, const std::string& name,
                              const std::string& path) {
  Channel channel;
  channel.name_ = name;
  channel.base_.constant = 0;
  channel.factor_.constant = 1;

  // Derived channels: light after the gather, and the picture of ambient occlusion
  const Triple irradiance = findTriple(element, "irradiance");
  const Triple environment = findTriple(element, "environment");
  const RowField occlusion = RowField::find(element, "occlusion");
  if ((name == "lit" || name == "indirect") && (irradiance.exists() || environment.exists())) {
    const Triple color = findTriple(element, "color");
    const Triple albedo = findTriple(element, "albedo");
    const Triple radiosity = findTriple(element, "radiosity");
    channel.value_ = irradiance;
    channel.added_ = environment;
    if (albedo.exists() || color.exists()) channel.factor_ = albedo.exists() ? albedo : color;
    if (name == "lit" && (radiosity.exists() || color.exists())) {
      channel.base_ = radiosity.exists() ? radiosity : color;
    }
    return channel;
  }
  if (name == "ao" && occlusion.exists()) {
    channel.base_.constant = 1;
    channel.sign_ = -1;
    channel.value_.fields = {occlusion, occlusion, occlusion};
    return channel;
  }

  // Triples, then scalars
  channel.value_ = findTriple(element, name);
  if (channel.value_.exists()) {
    if (name == "normal" || element.find(name + "_x") != nullptr) {
      channel.kind_ = ValueKind::kNormal;
    }
    if (name == "position") channel.kind_ = ValueKind::kPosition;
    return channel;
  }
  const RowField scalar = RowField::find(element, name);
  if (scalar.exists()) {
    channel.value_.fields = {scalar, scalar, scalar};
    if (scalar.type == ValueType::kUint8 && (isCode(element, name) || name == "occlusion")) {
      channel.value_.display_scale = displayScale(scalar.type);
    } else if (name != "occlusion") {
      channel.kind_ = ValueKind::kScalar;
    }
    return channel;
  }
  return Status::invalidArgument(fmt::format("{}: no channel \"{}\"; this cloud has: {}", path,
                                             name, fmt::join(list(element), ", ")));
}

std::vector<std::string> Channel::list(const RowLayout& element) {
  std::vector<std::string> names;
  const auto addOnce = [&](const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  if (findTriple(element, "irradiance").exists() || findTriple(element, "environment").exists()) {
    addOnce("lit");
    addOnce("indirect");
  }
  if (RowField::find(element, "occlusion").exists()) addOnce("ao");

  // A property is listed under its triple where it belongs to one
  for (const RowProperty& property : element.properties) {
    if (property.is_list) continue;
    std::string listed = property.name;
    for (const NamedTriple& named : kNamedTriples) {
      const bool is_member = std::find(named.properties.begin(), named.properties.end(),
                                       property.name) != named.properties.end();
      if (is_member && findTriple(element, std::string(named.name)).exists()) listed = named.name;
    }
    if (property.name.size() > 2 && property.name[property.name.size() - 2] == '_') {
      const std::string prefix = property.name.substr(0, property.name.size() - 2);
      if (findTriple(element, prefix).exists()) listed = prefix;
    }
    addOnce(listed);
  }
  return names;
}

std::string Channel::choose(const RowLayout& element) {
  const auto has = [&](const char* name) { return findTriple(element, name).exists(); };
  if (has("irradiance") || has("environment")) return "lit";
  if (RowField::find(element, "occlusion").exists()) return "ao";
  if (has("radiosity")) return "radiosity";
  if (has("color")) return "color";
  if (has("albedo")) return "albedo";
  if (has("normal")) return "normal";
  return "position";
}

glm::vec3 Channel::value(const std::byte* row) const {
  return base_.read(row) + sign_ * factor_.read(row) * (value_.read(row) + added_.read(row));
}

}  // namespace surfeit
