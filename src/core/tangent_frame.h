// Two unit vectors at right angles to a normal and to each other.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>

namespace surfeit {

// (tangent, bitangent, normal) is right-handed. Immutable.
struct TangentFrame {
  glm::vec3 tangent, bitangent;

  // Of a unit normal. Any frame will do; this one is continuous but for one direction
  // (Duff et al. 2017).
  explicit TangentFrame(const glm::vec3& normal) {
    const float sign = std::copysign(1.0f, normal.z);
    const float a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
    tangent = {1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x};
    bitangent = {b, sign + normal.y * normal.y * a, -normal.y};
  }
};

}  // namespace surfeit
