// This work is based on: John Skilling. Programming the Hilbert curve. AIP Conference
// Proceedings 707, 2004. The transpose form: bit b of axis i is bit 3 * b + (2 - i) of the key.
#include "core/curve_key.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace surfeit {
namespace {

// Spreads the low 21 bits so that bit b lands at bit 3 * b.
std::uint64_t spreadBits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffull;
  v = (v | v << 16) & 0x1f0000ff0000ffull;
  v = (v | v << 8) & 0x100f00f00f00f00full;
  v = (v | v << 4) & 0x10c30c30c30c30c3ull;
  v = (v | v << 2) & 0x1249249249249249ull;
  return v;
}

// Inverse of spreadBits.
std::uint32_t gatherBits(std::uint64_t v) {
  v &= 0x1249249249249249ull;
  v = (v | v >> 2) & 0x10c30c30c30c30c3ull;
  v = (v | v >> 4) & 0x100f00f00f00f00full;
  v = (v | v >> 8) & 0x1f0000ff0000ffull;
  v = (v | v >> 16) & 0x1f00000000ffffull;
  v = (v | v >> 32) & 0x1fffff;
  return static_cast<std::uint32_t>(v);
}

constexpr std::uint32_t kTopBit = 1u << (kCurveLevels - 1);

}  // namespace

CurveKey curveKey(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  std::uint32_t axes[3] = {x, y, z};
  // Undo the rotations from the coarsest level to the finest
  for (std::uint32_t bit = kTopBit; bit > 1; bit >>= 1) {
    const std::uint32_t below = bit - 1;
    for (std::uint32_t& axis : axes) {
      if (axis & bit) {
        axes[0] ^= below;
      } else {
        const std::uint32_t swap = (axes[0] ^ axis) & below;
        axes[0] ^= swap;
        axis ^= swap;
      }
    }
  }
  // Gray encode
  axes[1] ^= axes[0];
  axes[2] ^= axes[1];
  std::uint32_t flip = 0;
  for (std::uint32_t bit = kTopBit; bit > 1; bit >>= 1) {
    if (axes[2] & bit) flip ^= bit - 1;
  }
  return spreadBits(axes[0] ^ flip) << 2 | spreadBits(axes[1] ^ flip) << 1 |
         spreadBits(axes[2] ^ flip);
}

void curveCell(CurveKey key, std::uint32_t& x, std::uint32_t& y, std::uint32_t& z) {
  std::uint32_t axes[3] = {gatherBits(key >> 2), gatherBits(key >> 1), gatherBits(key)};
  // Gray decode
  const std::uint32_t gray = axes[2] >> 1;
  axes[2] ^= axes[1];
  axes[1] ^= axes[0];
  axes[0] ^= gray;
  // Redo the rotations from the finest level to the coarsest
  for (std::uint32_t bit = 2; bit != kTopBit << 1; bit <<= 1) {
    const std::uint32_t below = bit - 1;
    for (int i = 2; i >= 0; --i) {
      if (axes[i] & bit) {
        axes[0] ^= below;
      } else {
        const std::uint32_t swap = (axes[0] ^ axes[i]) & below;
        axes[0] ^= swap;
        axes[i] ^= swap;
      }
    }
  }
  x = axes[0];
  y = axes[1];
  z = axes[2];
}

CurveKey curveKey(const glm::vec3& position, const RootCube& cube) {
  const double cells = double(1u << kCurveLevels);
  std::uint32_t cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (double(position[axis]) - cube.origin[axis]) / cube.size * cells;
    cell[axis] = static_cast<std::uint32_t>(std::clamp(at, 0.0, cells - 1));
  }
  return curveKey(cell[0], cell[1], cell[2]);
}

}  // namespace surfeit
