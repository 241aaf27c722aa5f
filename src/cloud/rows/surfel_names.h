// Names of properties that come in threes or under several names, as clouds have them and as we
// write them.
#pragma once

#include <algorithm>
#include <iterator>
#include <string_view>

namespace surfeit {

inline constexpr const char* kPositionNames[3] = {"x", "y", "z"};
inline constexpr const char* kNormalNames[3] = {"nx", "ny", "nz"};
inline constexpr const char* kLongSideNames[3] = {"long_side_x", "long_side_y", "long_side_z"};
inline constexpr const char* kRadiosityNames[3] = {"radiosity_r", "radiosity_g", "radiosity_b"};
inline constexpr const char* kAlbedoNames[3] = {"albedo_r", "albedo_g", "albedo_b"};
inline constexpr const char* kOpacityNames[3] = {"opacity_r", "opacity_g", "opacity_b"};
inline constexpr const char* kColorNames[3] = {"red", "green", "blue"};

// The radius of a surfel: the first of these that a cloud has; a width is twice the radius.
inline constexpr const char* kRadiusNames[] = {"radius", "pscale", "width"};

// The group of a surfel: the first of these that a cloud has. We write the first.
inline constexpr const char* kGroupNames[] = {"group", "light_group"};

// Whether a surfel takes a value from properties of that name.
inline bool isSurfelProperty(std::string_view name) {
  const auto holds = [name](const auto& names) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
  };
  return holds(kPositionNames) || holds(kNormalNames) || holds(kRadiosityNames) ||
         holds(kAlbedoNames) || holds(kColorNames) || holds(kRadiusNames) || holds(kGroupNames) ||
         holds(kLongSideNames) || holds(kOpacityNames) || name == "area" || name == "coverage" ||
         name == "opacity" || name == "two_sided";
}

}  // namespace surfeit
