// Axis-aligned boxes and the cube that the octree divides.
#pragma once

#include <algorithm>
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

// The octree's root cell: the smallest cube from `origin` that holds the bounds. In double, so that
// a cloud far from the origin keeps all 21 bits of the curve.
struct RootCube {
  double origin[3] = {0, 0, 0};
  double size = 1;
};

// A size of zero (all points equal) becomes 1 so that the curve stays defined.
inline RootCube rootCube(const Bounds3& bounds) {
  RootCube cube;
  double size = 0;
  for (int axis = 0; axis < 3; ++axis) {
    cube.origin[axis] = double(bounds.min[axis]);
    size = std::max(size, double(bounds.max[axis]) - double(bounds.min[axis]));
  }
  cube.size = size > 0 ? size : 1;
  return cube;
}

}  // namespace surfeit
