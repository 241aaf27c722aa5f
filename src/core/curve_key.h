// Curve keys: positions along a 3D Hilbert curve, 21 bits per axis. Every octree
// cell is one contiguous run of keys, and consecutive runs are neighbours in space, which is what
// makes pages, cuts and receivers coherent.
//
//   key = [ 0 : 1 | octal digit of level 1 : 3 | level 2 : 3 | ... | level 21 : 3 ]
//
// The first k digits name the cell of level k; level 0 is the root cube.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "core/bounds.h"

namespace surfeit {

using CurveKey = std::uint64_t;

inline constexpr int kCurveLevels = 21;

// The key of the cell with integer coordinates in [0, 2^21) along each axis. This is the definition
// of the curve, bit by bit; the functions of positions below find the same keys by tables, 25 times
// as fast.
CurveKey curveKey(std::uint32_t x, std::uint32_t y, std::uint32_t z);

// The key of a world position, which must be finite; positions outside the cube get the key of the
// nearest cell.
CurveKey curveKey(const glm::vec3& position, const RootCube& cube);

// The keys of keys.size() positions, the first at `position` and each of the others `stride_bytes`
// after the one before, as they stand in an array of larger structs. About 9 ns a key.
void curveKeys(const glm::vec3* position, std::size_t stride_bytes, const RootCube& cube,
               std::span<CurveKey> keys);

// Inverse of curveKey(x, y, z).
void curveCell(CurveKey key, std::uint32_t& x, std::uint32_t& y, std::uint32_t& z);

// The cell of a level that a world position lies in.
Bounds3 cellBounds(const glm::vec3& position, int level, const RootCube& cube);

// The first level (1..21) at which two keys lie in different cells; 22 when they are equal.
inline int firstDifferentLevel(CurveKey a, CurveKey b) {
  if (a == b) return kCurveLevels + 1;
  const int highest_bit = 63 - __builtin_clzll(a ^ b);
  return kCurveLevels - highest_bit / 3;
}

}  // namespace surfeit
