// Symmetric 3 x 3 matrices: spreads of surface around a point.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace surfeit {

// Entries xx, yy, zz, xy, xz, yz.
struct SymmetricMatrix {
  static constexpr std::size_t kEntries = 6;
  static constexpr std::array<int, kEntries> kRow = {0, 1, 2, 0, 0, 1};
  static constexpr std::array<int, kEntries> kColumn = {0, 1, 2, 1, 2, 2};
  // Where row i and column j are.
  static constexpr std::size_t kAt[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};

  std::array<float, kEntries> entries;

  float operator()(int row, int column) const { return entries[kAt[row][column]]; }
  float trace() const { return entries[0] + entries[1] + entries[2]; }
};

inline SymmetricMatrix operator*(float factor, const SymmetricMatrix& m) {
  SymmetricMatrix scaled = m;
  for (float& entry : scaled.entries) entry *= factor;
  return scaled;
}

// I - v v^T: what a disk with unit normal v spreads along its plane.
inline SymmetricMatrix withoutDirection(const glm::vec3& v) {
  return {{1 - v.x * v.x, 1 - v.y * v.y, 1 - v.z * v.z, -v.x * v.y, -v.x * v.z, -v.y * v.z}};
}

inline glm::vec3 operator*(const SymmetricMatrix& m, const glm::vec3& v) {
  return {m(0, 0) * v.x + m(0, 1) * v.y + m(0, 2) * v.z,
          m(1, 0) * v.x + m(1, 1) * v.y + m(1, 2) * v.z,
          m(2, 0) * v.x + m(2, 1) * v.y + m(2, 2) * v.z};
}

// v^T M v.
inline float quadraticForm(const SymmetricMatrix& m, const glm::vec3& v) {
  return glm::dot(v, m * v);
}

// The adjugate: det(M) times the inverse. In unit direction v its quadratic form is the determinant
// of M as projected along v.
inline SymmetricMatrix adjugate(const SymmetricMatrix& m) {
  const float xx = m(0, 0), yy = m(1, 1), zz = m(2, 2), xy = m(0, 1), xz = m(0, 2), yz = m(1, 2);
  return {{yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy, xz * yz - xy * zz,
           xy * yz - xz * yy, xy * xz - xx * yz}};
}

// How much of a volume something with this covariance fills, 0 to 1: all where it spreads alike in
// all directions, nothing where it lies on a plane. 9 det C / (trace C trace adj C).
inline float volumePart(const SymmetricMatrix& covariance) {
  const float trace = covariance.trace();
  if (!(trace >= std::numeric_limits<float>::min())) return 0;
  const SymmetricMatrix c = (1 / trace) * covariance, minors = adjugate(c);
  const float determinant =
      c(0, 0) * minors(0, 0) + c(0, 1) * minors(0, 1) + c(0, 2) * minors(0, 2);
  return minors.trace() > 0 ? std::clamp(9 * determinant / minors.trace(), 0.f, 1.f) : 0;
}

}  // namespace surfeit
