// Brightness of colors.
#pragma once

#include <glm/vec3.hpp>

namespace surfeit {

// The brightness of Rec. 709 primaries of equal strength.
inline constexpr glm::vec3 kLuminance = {0.2126f, 0.7152f, 0.0722f};

inline float luminance(const glm::vec3& rgb) {
  return kLuminance.x * rgb.x + kLuminance.y * rgb.y + kLuminance.z * rgb.z;
}

inline double luminance(const glm::dvec3& rgb) {
  return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z;
}

}  // namespace surfeit
