#include "cloud/rows/property_aliases.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

using Triple = std::array<std::string_view, 3>;

// What stands behind a stem: color_red, color_r, color_0, ...
constexpr Triple kColorWords[] = {{"red", "green", "blue"}, {"r", "g", "b"}, {"rf", "gf", "bf"}};
constexpr std::string_view kAlphaWords[] = {"alpha", "a", "af"};  // beside each of these
constexpr Triple kNumbers = {"0", "1", "2"};
constexpr Triple kAxes = {"x", "y", "z"};

// In lower case; the first that an element has is read.
constexpr std::string_view kColorStems[] = {"",     "diffuse_", "color_", "colour_",
                                            "rgb_", "color",    "colour", "col_",
                                            "cd_",  "vertex_",  "diffuse"};
constexpr std::string_view kNormalStems[] = {"n",     "normal_", "normal", "n_",
                                             "norm_", "norm",    "nor_",   "normals_"};
constexpr std::string_view kPositionStems[] = {"", "position_", "pos_", "p_"};

// Single values that are one less an opacity.
constexpr std::string_view kTransparencies[] = {"transparency", "transparence"};

// What CloudCompare writes in front of the names of its scalar fields.
constexpr std::string_view kScalarPrefix = "scalar_";
// What stands there when a converter of splats wrote the names that CloudCompare shows.
constexpr std::string_view kSplatPrefixes[] = {"scalar_scal_", kScalarPrefix};
// Those of Gaussian splats, which stay together.
constexpr std::string_view kSplatStems[] = {"f_dc_", "f_rest_", "scale_", "rot_"};

// Single values that surfels or receivers have.
constexpr std::string_view kSingles[] = {"radius", "pscale", "width", "area", "two_sided", "group",
                                         "alpha",  "id",     "rgb",   "rgba", "intensity"};

// Single values that look like colors, and like widths.
constexpr std::string_view kGrays[] = {"gray", "grey", "luminance", "brightness"};
constexpr std::string_view kSizes[] = {"diameter", "size", "surfel_size", "point_size",
                                       "pointsize"};

std::string lowerOf(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

// Gives the properties of one element their names.
class Namer {
 public:
  explicit Namer(const RowLayout& element) : element_(element) {
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      const RowProperty& property = element.properties[i];
      names_.push_back(property.name);
      if (property.is_list) continue;
      by_name_.emplace(property.name, i);
      by_lower_.emplace(lowerOf(property.name), i);  // the first, where several differ by case
    }
  }

  std::vector<std::string> names() {
    nameSplats();
    nameTriple({kPositionNames[0], kPositionNames[1], kPositionNames[2]}, kPositionStems);
    nameTriple({kNormalNames[0], kNormalNames[1], kNormalNames[2]}, kNormalStems);
    nameTriple({kColorNames[0], kColorNames[1], kColorNames[2]}, kColorStems);
    for (const auto& names :
         {kRadiosityNames, kAlbedoNames, kPowerNames, kIncidentNames, kLongSideNames}) {
      nameTriple({names[0], names[1], names[2]}, {});
    }
    for (const std::string_view name : kSingles) {
      const std::array<std::optional<std::size_t>, 2> found = {find(name), findScalar(name)};
      for (const auto& property : found) {
        if (property && !has(name)) give(*property, name);
      }
    }
    return std::move(names_);
  }

 private:
  static constexpr const char* kPowerNames[3] = {"power_r", "power_g", "power_b"};
  static constexpr const char* kIncidentNames[3] = {"incident_x", "incident_y", "incident_z"};

  bool has(std::string_view name) const { return by_name_.contains(std::string(name)); }

  // A property of that name in any case.
  std::optional<std::size_t> find(std::string_view lower_name) const {
    const auto entry = by_lower_.find(std::string(lower_name));
    return entry != by_lower_.end() ? std::optional(entry->second) : std::nullopt;
  }
  std::optional<std::size_t> findScalar(std::string_view lower_name) const {
    return find(std::string(kScalarPrefix) + std::string(lower_name));
  }

  void give(std::size_t property, std::string_view name) {
    names_[property] = name;
    by_name_.emplace(name, property);
  }

  // Takes all three or none.
  bool takeTriple(const Triple& ours, std::string_view stem, const Triple& words) {
    for (const std::string_view prefix : {std::string_view(), kScalarPrefix}) {
      std::array<std::optional<std::size_t>, 3> found;
      for (std::size_t i = 0; i < 3; ++i) {
        found[i] = find(std::string(prefix) + std::string(stem) + std::string(words[i]));
      }
      if (!found[0] || !found[1] || !found[2]) continue;
      for (std::size_t i = 0; i < 3; ++i) give(*found[i], ours[i]);
      return true;
    }
    return false;
  }

  // Whatever the case of ours, then stem by stem.
  void nameTriple(const Triple& ours, std::span<const std::string_view> stems) {
    if (has(ours[0]) || has(ours[1]) || has(ours[2])) return;
    if (takeTriple(ours, "", ours)) return;
    for (const std::string_view stem : stems) {
      if (ours[0] != kColorNames[0]) {
        if (takeTriple(ours, stem, kAxes)) return;
      } else {
        for (std::size_t i = 0; i < std::size(kColorWords); ++i) {
          if (!takeTriple(ours, stem, kColorWords[i])) continue;
          return takeAlpha(stem, {kAlphaWords[i], kAlphaWords[0]});
        }
      }
      // color0 would be a name that numbers colors
      if (!stem.ends_with('_') || !takeTriple(ours, stem, kNumbers)) continue;
      if (ours[0] == kColorNames[0]) takeAlpha(stem, {"3", kAlphaWords[0]});
      return;
    }
  }

  // What stands beside a color of that stem.
  void takeAlpha(std::string_view stem, std::array<std::string_view, 2> words) {
    for (const std::string_view word : words) {
      for (const std::string_view prefix : {std::string_view(), kScalarPrefix}) {
        const auto found = find(std::string(prefix) + std::string(stem) + std::string(word));
        if (found && !has("alpha")) give(*found, "alpha");
      }
    }
  }

  void nameSplats() {
    for (const std::string_view prefix : kSplatPrefixes) {
      if (has("f_dc_0")) return;
      if (has(std::string(prefix) + "f_dc_0")) nameSplatsBehind(prefix);
    }
  }
  void nameSplatsBehind(std::string_view prefix) {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const std::string_view name = element_.properties[i].name;
      if (element_.properties[i].is_list || !name.starts_with(prefix)) continue;
      const std::string_view rest = name.substr(prefix.size());
      const bool is_of_splat =
          rest == "opacity" ||
          std::any_of(std::begin(kSplatStems), std::end(kSplatStems),
                      [&](std::string_view stem) { return rest.starts_with(stem); });
      if (is_of_splat && !has(rest)) give(i, rest);
    }
  }

  const RowLayout& element_;
  std::vector<std::string> names_;
  std::unordered_map<std::string, std::size_t> by_name_, by_lower_;
};

bool isLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool isUpper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }

// Whether [at, at + size) is a word of a name: no letters around it but where the case changes.
bool isWord(std::string_view name, std::size_t at, std::size_t size) {
  const std::size_t end = at + size;
  const bool begins = at == 0 || !isLetter(name[at - 1]) || (isUpper(name[at]) && size > 1) ||
                      (isUpper(name[at]) && !isUpper(name[at - 1]));
  const bool ends = end == name.size() || !isLetter(name[end]) || isUpper(name[end]);
  return begins && ends;
}

// The properties of an element that are called like each other but for one of three words.
class LookalikeFinder {
 public:
  explicit LookalikeFinder(const RowLayout& element) : element_(element) {
    for (const RowChannel& channel : channelsOf(element)) {
      // What we know is something else
      if (isKnownChannel(channel.name)) continue;
      for (const std::size_t i : channel.properties) {
        const std::string& name = element.properties[i].name;
        lower_.emplace(lowerOf(name), name);
        if (channel.properties.size() == 3) channel_of_.emplace(name, channel.name);
      }
    }
  }

  bool has(std::string_view lower) const { return lower_.contains(std::string(lower)); }
  // Properties of these names, in lower case.
  template <typename Names>
  std::vector<std::string> singles(const Names& names) const {
    std::vector<std::string> found;
    for (const std::string_view name : names) {
      for (const std::string& each :
           {std::string(name), std::string(kScalarPrefix) + std::string(name)}) {
        const auto entry = lower_.find(each);
        if (entry != lower_.end()) found.push_back(entry->second);
      }
    }
    return found;
  }

  // `words` in lower case. `is_wanted` gets the name and where the word stands in it.
  template <typename IsWanted>
  void tell(const Triple& words, const Triple& ours, std::string_view channel, IsWanted is_wanted,
            std::vector<std::string>& notes) {
    for (const auto& [lower, name] : lower_) {
      for (std::size_t at = lower.find(words[0]); at != lower.npos;
           at = lower.find(words[0], at + 1)) {
        if (told_.contains(name) || !is_wanted(std::string_view(name), at)) continue;
        const std::string head = lower.substr(0, at), tail = lower.substr(at + words[0].size());
        const auto second = lower_.find(head + std::string(words[1]) + tail);
        const auto third = lower_.find(head + std::string(words[2]) + tail);
        if (second == lower_.end() || third == lower_.end()) continue;
        const std::array<std::string, 3> names = {name, second->second, third->second};
        for (const std::string& told : names) told_.insert(told);
        notes.push_back(fmt::format("properties {} look like a {} and are not read: --channels {}",
                                    fmt::join(names, " "), channel,
                                    renaming(names, ours, channel)));
      }
    }
  }

  // Names of normals of which one or two are there.
  void tellIncomplete(std::vector<std::string>& notes) const {
    for (const std::string_view stem : kNormalStems) {
      std::string names, drops;
      int count = 0;
      for (const std::string_view axis : kAxes) {
        const auto entry = lower_.find(std::string(stem) + std::string(axis));
        if (entry == lower_.end()) continue;
        ++count;
        names += fmt::format("{}{}", names.empty() ? "" : " ", entry->second);
        drops += fmt::format("{}{}", drops.empty() ? "" : ",", dropsOf(element_, entry->second));
      }
      if (count == 0 || count == 3) continue;
      notes.push_back(fmt::format(
          "properties {} look like a normal that lacks a component, and are not read: surfeit "
          "normals finds whole ones, --channels {} leaves them out",
          names, drops));
    }
  }

 private:
  // foo=color where the three are a channel, else the properties one by one.
  std::string renaming(const std::array<std::string, 3>& names, const Triple& ours,
                       std::string_view channel) const {
    const auto entry = channel_of_.find(names[0]);
    const std::string typed = typedNames(element_, names[0]).front();
    if (entry != channel_of_.end()) {
      return fmt::format("{}={}", typed == names[0] ? entry->second : typed, channel);
    }
    return fmt::format("{}={},{}={},{}={}", typed, ours[0], typedNames(element_, names[1]).front(),
                       ours[1], typedNames(element_, names[2]).front(), ours[2]);
  }

  const RowLayout& element_;
  std::map<std::string, std::string> lower_;  // names by lower case, in an order
  std::unordered_map<std::string, std::string> channel_of_;
  std::set<std::string> told_;
};

}  // namespace

std::vector<std::string> knownNames(const RowLayout& element) { return Namer(element).names(); }

std::vector<std::string> notesOfLookalikes(const RowLayout& element,
                                           const LackingChannels& lacking) {
  std::vector<std::string> notes;
  LookalikeFinder finder(element);
  if (lacking.color) {
    for (const Triple& words : kColorWords) {
      const auto is_wanted = [&](std::string_view name, std::size_t at) {
        return isWord(name, at, words[0].size());
      };
      finder.tell(words, {kColorNames[0], kColorNames[1], kColorNames[2]}, "color", is_wanted,
                  notes);
    }
    for (const std::string& name : finder.singles(kGrays)) {
      notes.push_back(
          fmt::format("property {0} looks like a color and is not read: surfeit convert "
                      "--set 'radiosity = {0}' makes one of it",
                      name));
    }
    if (finder.has("f_dc_0")) {
      notes.push_back(
          "properties f_dc_0 f_dc_1 f_dc_2 look like colors of splats and are not read without the "
          "rest of a splat: surfeit convert --set 'radiosity = f_dc * .28209 + .5' makes colors");
    }
  }
  if (lacking.normal) {
    const auto is_wanted = [&](std::string_view name, std::size_t at) {
      const std::string lower = lowerOf(name);
      return lower.find("norm") != lower.npos || (at > 0 && lower[at - 1] == 'n') ||
             (at > 1 && lower[at - 1] == '_' && lower[at - 2] == 'n');
    };
    finder.tell(kAxes, {kNormalNames[0], kNormalNames[1], kNormalNames[2]}, "normal", is_wanted,
                notes);
    finder.tellIncomplete(notes);
  }
  if (lacking.opacity) {
    for (const std::string& name : finder.singles(kTransparencies)) {
      const ValueType type = element.find(name)->type;
      const int white = isFloatType(type) ? 1 : valueTypeBytes(type) == 1 ? 255 : 65535;
      notes.push_back(fmt::format(
          "property {0} looks like what surfels let through and is not read: convert --set "
          "\"alpha = {1} - {0}\", then --channels alpha=opacity",
          name, white));
    }
  }
  if (lacking.size) {
    for (const std::string& name : finder.singles(kSizes)) {
      notes.push_back(
          fmt::format("property {} looks like the width of surfels and is not read: "
                      "--channels {}=width",
                      name, typedNames(element, name).front()));
    }
  }
  return notes;
}

}  // namespace surfeit
