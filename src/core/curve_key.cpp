// This work is based on: John Skilling. Programming the Hilbert curve. AIP Conference
// Proceedings 707, 2004. The transpose form: bit b of axis i is bit 3 * b + (2 - i) of the key.
//
// Skilling's loop is the definition. Positions walk the same curve as an automaton, from the
// coarsest level to the finest: how the curve runs through the eight children of a cell depends on
// nothing but the cell's orientation, and there are 24 of those.
#include "core/curve_key.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kTopBit = 1u << (kCurveLevels - 1);
constexpr double kCellsPerAxis = 1u << kCurveLevels;

// --- Definition ---

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

// --- Automaton ---

namespace {

constexpr std::size_t kOrientations = 24;

// How the curve runs through the children of a cell; child = [ x : 1 | y : 1 | z : 1 ].
struct Orientation {
  std::array<std::uint8_t, 8> digit{};  // octal digit of each child
  std::array<std::uint8_t, 8> child{};  // orientation of each child
};

// A cell of some level, by its integer coordinates there.
struct Cell {
  int level = 0;
  std::uint32_t x = 0, y = 0, z = 0;

  Cell child(std::uint32_t index) const {
    return {level + 1, 2 * x + (index >> 2), 2 * y + (index >> 1 & 1), 2 * z + (index & 1)};
  }
  // The last of the octal digits that name the cell.
  std::uint8_t digit() const {
    const int below = kCurveLevels - level;
    return curveKey(x << below, y << below, z << below) >> 3 * below & 7;
  }
};

// Explores the curve from the root cube downwards until no cell shows a new orientation. Cells are
// of one orientation when their children have the same digits: the tests hold all levels to it.
std::array<Orientation, kOrientations> exploreOrientations() {
  std::array<Orientation, kOrientations> orientations{};
  std::array<Cell, kOrientations> examples{};
  std::size_t found = 0;
  const auto find = [&](const Cell& cell) {
    Orientation shown;
    for (std::uint32_t child = 0; child < 8; ++child) {
      shown.digit[child] = cell.child(child).digit();
    }
    std::size_t index = 0;
    while (index < found && shown.digit != orientations[index].digit) ++index;
    if (index == found) {
      SURFEIT_CHECK(found < kOrientations);
      orientations[found] = shown;
      examples[found++] = cell;
    }
    return static_cast<std::uint8_t>(index);
  };
  find(Cell{});
  for (std::size_t index = 0; index < found; ++index) {
    for (std::uint32_t child = 0; child < 8; ++child) {
      orientations[index].child[child] = find(examples[index].child(child));
    }
  }
  return orientations;
}

// Three levels at a time, 7 steps to a key, in 24 KiB:
//
//   index = [ orientation : 5 | x : 3 | y : 3 | z : 3 ]
//   entry = [ orientation below : 5 | octal digits of the three levels : 9 ]
constexpr int kStepLevels = 3;
constexpr int kStepBits = 3 * kStepLevels;
constexpr std::uint32_t kStepMask = (1u << kStepBits) - 1;
using StepTable = std::array<std::uint16_t, kOrientations << kStepBits>;

StepTable makeStepTable() {
  const std::array<Orientation, kOrientations> orientations = exploreOrientations();
  StepTable table{};
  for (std::uint32_t index = 0; index < table.size(); ++index) {
    std::uint32_t orientation = index >> kStepBits, digits = 0;
    for (int bit = kStepLevels - 1; bit >= 0; --bit) {
      const std::uint32_t child =
          (index >> (6 + bit) & 1) << 2 | (index >> (3 + bit) & 1) << 1 | (index >> bit & 1);
      digits = digits << 3 | orientations[orientation].digit[child];
      orientation = orientations[orientation].child[child];
    }
    table[index] = static_cast<std::uint16_t>(orientation << kStepBits | digits);
  }
  return table;
}

// Made by the first thread that asks: as a constant it takes more steps than some compilers do.
const StepTable& stepTable() {
  static const StepTable table = makeStepTable();
  return table;
}

// Spreads 21 bits so that bits 3 * g to 3 * g + 2 land at bit 9 * g.
inline std::uint64_t spreadGroups(std::uint64_t v) {
  v = (v | v << 24) & 0x1ff000000fff;
  v = (v | v << 12) & 0x1c003f000fc003f;
  v = (v | v << 6) & 0x1c0e070381c0e07;
  return v;
}

// The key of a cell by its groups: spread x, y and z, one after the other in every 9 bits.
inline CurveKey walkGroups(std::uint64_t groups, const StepTable& table) {
  CurveKey key = 0;
  std::uint32_t entry = 0;
  for (int shift = 3 * (kCurveLevels - kStepLevels); shift >= 0; shift -= kStepBits) {
    entry = table[(entry & ~kStepMask) | (static_cast<std::uint32_t>(groups >> shift) & kStepMask)];
    key = key << kStepBits | (entry & kStepMask);
  }
  return key;
}

// The cell of a coordinate along one axis. Division, as a product with the inverse rounds
// otherwise; by way of int32_t, which SSE2 can convert to.
inline std::int32_t cellAt(float position, double origin, double size) {
  const double at = (double{position} - origin) / size * kCellsPerAxis;
  return static_cast<std::int32_t>(std::clamp(at, 0.0, kCellsPerAxis - 1));
}

// Positions are taken in runs of this many, axis by axis, in loops that compilers vectorise.
constexpr std::size_t kRun = 64;

// The keys of a whole run.
void keysOfRun(const float (&positions)[3][kRun], const RootCube& cube, CurveKey* keys) {
  std::uint64_t groups[kRun] = {};
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = cube.origin[axis], size = cube.size;
    std::int32_t cells[kRun];
    for (std::size_t i = 0; i < kRun; ++i) cells[i] = cellAt(positions[axis][i], origin, size);
    for (std::size_t i = 0; i < kRun; ++i) {
      groups[i] = groups[i] << 3 | spreadGroups(static_cast<std::uint32_t>(cells[i]));
    }
  }
  const StepTable& table = stepTable();
  for (std::size_t i = 0; i < kRun; ++i) keys[i] = walkGroups(groups[i], table);
}

}  // namespace

CurveKey curveKey(const glm::vec3& position, const RootCube& cube) {
  std::uint64_t groups = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int32_t cell = cellAt(position[axis], cube.origin[axis], cube.size);
    groups = groups << 3 | spreadGroups(static_cast<std::uint32_t>(cell));
  }
  return walkGroups(groups, stepTable());
}

void curveKeys(const glm::vec3* position, std::size_t stride_bytes, const RootCube& cube,
               std::span<CurveKey> keys) {
  const auto* next = reinterpret_cast<const std::byte*>(position);
  float positions[3][kRun] = {};
  for (; !keys.empty(); keys = keys.subspan(std::min(kRun, keys.size()))) {
    const std::size_t count = std::min(kRun, keys.size());
    for (std::size_t i = 0; i < count; ++i, next += stride_bytes) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::memcpy(&positions[axis][i], next + axis * sizeof(float), sizeof(float));
      }
    }
    if (count == kRun) {
      keysOfRun(positions, cube, keys.data());
    } else {  // the last run; behind its end stand older positions, or zeros
      CurveKey last[kRun];
      keysOfRun(positions, cube, last);
      std::copy(last, last + count, keys.begin());
    }
  }
}

Bounds3 cellBounds(const glm::vec3& position, int level, const RootCube& cube) {
  const double size = std::ldexp(cube.size, -level);
  Bounds3 bounds;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int32_t cell =
        cellAt(position[axis], cube.origin[axis], cube.size) >> (kCurveLevels - level);
    const double low = cube.origin[axis] + size * double(cell);
    bounds.min[axis] = float(low);
    bounds.max[axis] = float(low + size);
  }
  return bounds;
}

}  // namespace surfeit
