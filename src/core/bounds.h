// Axis-aligned boxes and the cube that the octree divides.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace surfeit {

// An axis-aligned box in world units; empty (min > max) until a point is added.
template <typename T>
struct Box3 {
  using Vector = glm::vec<3, T>;
  Vector min{std::numeric_limits<T>::infinity()};
  Vector max{-std::numeric_limits<T>::infinity()};

  bool isEmpty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
  void add(const Vector& point) {
    min = glm::min(min, point);
    max = glm::max(max, point);
  }
  void add(const Box3& other) {
    min = glm::min(min, other.min);
    max = glm::max(max, other.max);
  }
  Vector extent() const { return isEmpty() ? Vector(0) : max - min; }
  T longestSide() const {
    const Vector sides = extent();
    return std::max({sides.x, sides.y, sides.z});
  }
  Vector centre() const { return isEmpty() ? Vector(0) : min + T(0.5) * (max - min); }
};
using Bounds3 = Box3<float>;
using Bounds3d = Box3<double>;

// The box of the points of another one, moved.
inline Bounds3d movedBounds(const Bounds3& bounds, const glm::dvec3& shift) {
  return {glm::dvec3(bounds.min) + shift, glm::dvec3(bounds.max) + shift};
}

// The octree's root cell. In double, so that a cloud far from the origin keeps all 21 bits of the
// curve.
struct RootCube {
  double origin[3] = {0, 0, 0};
  double size = 1;

  bool operator==(const RootCube&) const = default;
};

// Whether the box lies in the cube.
inline bool contains(const RootCube& cube, const Bounds3& bounds) {
  for (int axis = 0; axis < 3; ++axis) {
    if (double(bounds.min[axis]) < cube.origin[axis] ||
        double(bounds.max[axis]) > cube.origin[axis] + cube.size) {
      return false;
    }
  }
  return true;
}

// The cube for a box: its size is a power of two and its origin a multiple of a 16th of that, so
// that a sample of a cloud nearly always gives the cube of the whole. A box of size zero gets 1.
inline RootCube rootCube(const Bounds3d& bounds) {
  const double extent = bounds.longestSide();
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
      cube.origin[axis] = std::floor(bounds.min[axis] / step) * step;
      fits = fits && bounds.max[axis] <= cube.origin[axis] + cube.size;
    }
    if (fits) return cube;
    cube.size *= 2;
  }
}
inline RootCube rootCube(const Bounds3& bounds) {
  return rootCube(movedBounds(bounds, glm::dvec3(0)));
}

// How far floats about 0 stand apart at the farthest coordinate of the box.
inline double floatStep(const Bounds3d& bounds) {
  const glm::dvec3 farthest = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
  const float most = float(std::max({farthest.x, farthest.y, farthest.z}));
  return double(std::nextafter(most, std::numeric_limits<float>::infinity())) - double(most);
}

// Where the places of a cloud with this box are counted from. Floats about 0 serve a box that is no
// farther from 0 than twice its root cube is wide: they have all but two bits of the digits that
// they could have. Others, on a map or a globe, are counted from a corner of their cube, so that a
// cloud that is moved by steps of the cube keeps every coordinate.
inline glm::dvec3 originFor(const Bounds3d& bounds) {
  const RootCube cube = rootCube(bounds);
  const glm::dvec3 farthest = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
  if (std::max({farthest.x, farthest.y, farthest.z}) <= 3 * cube.size) return glm::dvec3(0);
  return {cube.origin[0], cube.origin[1], cube.origin[2]};
}

}  // namespace surfeit
