// Symmetric 3 x 3 matrices: spreads of surface around a point.
#pragma once

#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

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

}  // namespace surfeit
