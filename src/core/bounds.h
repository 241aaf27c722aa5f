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

// The least power of two that is at least the longest side of a box; 1 for a box of size zero.
inline double cubeSize(const Bounds3d& bounds) {
  const double extent = bounds.longestSide();
  if (!(extent > 0)) return 1;
  int exponent = 0;
  const double mantissa = std::frexp(extent, &exponent);  // in [1/2, 1)
  return std::ldexp(1, mantissa == 0.5 ? exponent - 1 : exponent);
}

// Part of a step by which corners of cubes lie beside round numbers: a third, in 14 binary digits,
// so that cells down to a 2^17th of the cube do. Floors and walls are built at round numbers; a
// border of cells there would put half of a noisy floor into one cell and half into another.
inline constexpr double kBesideRound = 5461. / (1 << 14);

// The cube for a box: its size is a power of two and its corner lies a third of a step after a
// multiple of the step, a 16th of the size, so that a sample of a cloud nearly always gives the
// cube of the whole. `beside`: another part of a step, 0 to 1.
inline RootCube rootCube(const Bounds3d& bounds, double beside = kBesideRound) {
  RootCube cube;
  for (cube.size = cubeSize(bounds);; cube.size *= 2) {
    const double step = cube.size / 16;
    bool fits = true;
    for (int axis = 0; axis < 3; ++axis) {
      const double before = std::floor(bounds.min[axis] / step - beside);
      cube.origin[axis] = (before + beside) * step;
      fits = fits && bounds.max[axis] <= cube.origin[axis] + cube.size;
    }
    if (fits) return cube;
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
// farther from 0 than twice its size as a power of two: they have all but two bits of the digits
// that they could have. Others, on a map or a globe, are counted from the multiple of a 16th of
// that size before them, so that a cloud that is moved by such steps keeps every coordinate.
inline glm::dvec3 originFor(const Bounds3d& bounds) {
  const double size = cubeSize(bounds);
  const glm::dvec3 farthest = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
  if (std::max({farthest.x, farthest.y, farthest.z}) <= 3 * size) return glm::dvec3(0);
  return glm::floor(bounds.min * (16 / size)) * (size / 16);
}

}  // namespace surfeit
