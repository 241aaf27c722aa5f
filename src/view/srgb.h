// The sRGB transfer curve (IEC 61966-2-1): between display values, as pictures and 8-bit colors
// store them, and scene-linear light.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

namespace surfeit {

inline float linearFromSrgb(float display) {
  return display <= 0.04045f ? display / 12.92f : std::pow((display + 0.055f) / 1.055f, 2.4f);
}

inline float srgbFromLinear(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

inline glm::vec3 linearFromSrgb(const glm::vec3& display) {
  return {linearFromSrgb(display.x), linearFromSrgb(display.y), linearFromSrgb(display.z)};
}

}  // namespace surfeit
