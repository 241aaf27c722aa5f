// Brightness of colors.
#pragma once

#include <glm/vec3.hpp>

namespace surfeit {

// The brightness of Rec. 709 primaries of equal strength.
inline constexpr glm::dvec3 kLuminanceInDoubles = {0.2126, 0.7152, 0.0722};
inline constexpr glm::vec3 kLuminance(kLuminanceInDoubles);

inline float luminance(const glm::vec3& rgb) {
  return kLuminance.x * rgb.x + kLuminance.y * rgb.y + kLuminance.z * rgb.z;
}

inline double luminance(const glm::dvec3& rgb) {
  return kLuminanceInDoubles.x * rgb.x + kLuminanceInDoubles.y * rgb.y +
         kLuminanceInDoubles.z * rgb.z;
}

}  // namespace surfeit
