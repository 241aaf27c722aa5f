// The normal of a surfel from the three numbers of a record.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace surfeit {

// Shorter normals point nowhere.
inline constexpr double kMinNormalLength = 1e-6;

enum class NormalKind {
  kDirection,
  kNone,      // zero: a sphere
  kTooShort,  // not zero, and shorter than kMinNormalLength
};

// The squares of floats fit doubles, so that the length is neither lost nor infinite.
inline double normalLength(double x, double y, double z) {
  return std::sqrt(x * x + y * y + z * z);
}

// Sets `normal` to unit length along (x, y, z), or to zero when there is no direction.
inline NormalKind normalise(double x, double y, double z, glm::vec3& normal) {
  const double length = normalLength(x, y, z);
  if (length >= kMinNormalLength) {
    normal = {static_cast<float>(x / length), static_cast<float>(y / length),
              static_cast<float>(z / length)};
    return NormalKind::kDirection;
  }
  normal = glm::vec3(0);
  return x == 0 && y == 0 && z == 0 ? NormalKind::kNone : NormalKind::kTooShort;
}

}  // namespace surfeit
