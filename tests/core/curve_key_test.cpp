#include "core/curve_key.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

namespace surfeit {
namespace {

TEST(CurveKey, InverseReturnsTheCell) {
  std::mt19937 random(1);
  for (int i = 0; i < 10000; ++i) {
    const std::uint32_t x = random() >> 11, y = random() >> 11, z = random() >> 11;
    std::uint32_t a, b, c;
    curveCell(curveKey(x, y, z), a, b, c);
    ASSERT_EQ(x, a);
    ASSERT_EQ(y, b);
    ASSERT_EQ(z, c);
  }
}

TEST(CurveKey, ConsecutiveKeysAreFaceNeighbours) {
  std::mt19937_64 random(2);
  for (int run = 0; run < 100; ++run) {
    CurveKey key = random() >> 1;
    for (int i = 0; i < 100 && key + 1 < (CurveKey{1} << 63); ++i, ++key) {
      std::uint32_t a[3], b[3];
      curveCell(key, a[0], a[1], a[2]);
      curveCell(key + 1, b[0], b[1], b[2]);
      int steps = 0;
      for (int axis = 0; axis < 3; ++axis) steps += std::abs(int(a[axis]) - int(b[axis]));
      ASSERT_EQ(steps, 1);
    }
  }
}

TEST(CurveKey, OctreeCellsAreContiguousRuns) {
  // Cells of level k share their first k digits exactly when they share k bits of each axis
  std::mt19937 random(3);
  for (int i = 0; i < 10000; ++i) {
    const std::uint32_t x = random() >> 11, y = random() >> 11, z = random() >> 11;
    const int level = int(random() % 21) + 1;
    const std::uint32_t below = (1u << (kCurveLevels - level)) - 1;
    const CurveKey a = curveKey(x, y, z);
    const CurveKey b =
        curveKey((x & ~below) | (random() & below), (y & ~below) | (random() & below),
                 (z & ~below) | (random() & below));
    ASSERT_GT(firstDifferentLevel(a, b), level);
    const CurveKey c = curveKey(x ^ (below + 1), y, z);
    ASSERT_LE(firstDifferentLevel(a, c), level);
  }
}

TEST(CurveKey, PositionsOutsideTheCubeAreClamped) {
  const RootCube cube{{0, 0, 0}, 1};
  EXPECT_EQ(curveKey(glm::vec3(-5, 0, 0), cube), curveKey(glm::vec3(0, 0, 0), cube));
  EXPECT_EQ(curveKey(glm::vec3(9, 9, 9), cube), curveKey(glm::vec3(1, 1, 1), cube));
}

}  // namespace
}  // namespace surfeit
