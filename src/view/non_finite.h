// What is no number: scenes and passes of others may hold it, and pictures must show where.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace surfeit {

// Values that are no numbers cannot hide in this color.
inline constexpr glm::vec3 kNonFiniteColor{1, 0, 1};

inline bool isFinite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace surfeit
