// Axis-aligned boxes and the cube that the octree divides.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace surfeit {

// An axis-aligned box in world units; empty (min > max) until a point is added.
struct Bounds3 {
  glm::vec3 min{std::numeric_limits<float>::infinity()};
  glm::vec3 max{-std::numeric_limits<float>::infinity()};

  bool isEmpty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
  void add(const glm::vec3& point) {
    min = glm::min(min, point);
    max = glm::max(max, point);
  }
  void add(const Bounds3& other) {
    min = glm::min(min, other.min);
    max = glm::max(max, other.max);
  }
  glm::vec3 extent() const { return isEmpty() ? glm::vec3(0) : max - min; }
  glm::vec3 centre() const { return isEmpty() ? glm::vec3(0) : min + 0.5f * (max - min); }
};

// The octree's root cell. In double, so that a cloud far from the origin keeps all 21 bits of the
// curve.
struct RootCube {
  double origin[3] = {0, 0, 0};
  double size = 1;

  bool operator==(const RootCube&) const = default;
};

// The cube for a box: its size is a power of two and its origin a multiple of a 16th of that, so
// that a sample of a cloud nearly always gives the cube of the whole. A box of size zero gets 1.
inline RootCube rootCube(const Bounds3& bounds) {
  double extent = 0;
  for (int axis = 0; axis < 3; ++axis) {
    extent = std::max(extent, double(bounds.max[axis]) - double(bounds.min[axis]));
  }
  RootCube cube;
  if (extent > 0) {
    int exponent = 0;
    const double mantissa = std::frexp(extent, &exponent);  // in [1/2, 1)
    cube.size = std::ldexp(1, mantissa == 0.5 ? exponent - 1 : exponent);
  }
  for (;;) {
    bool fits = true;
    for (int axis = 0; axis < 3; ++axis) {
      const double step = cube.size / 16;
      cube.origin[axis] = std::floor(double(bounds.min[axis]) / step) * step;
      fits = fits && double(bounds.max[axis]) <= cube.origin[axis] + cube.size;
    }
    if (fits) return cube;
    cube.size *= 2;
  }
}

}  // namespace surfeit
