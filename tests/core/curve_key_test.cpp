#include "core/curve_key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <span>
#include <vector>

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

// A cube whose cells have edges of 1, so that positions are cells.
constexpr RootCube kCellCube{{0, 0, 0}, double(1u << kCurveLevels)};

CurveKey keyAt(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return curveKey(glm::vec3(float(x), float(y), float(z)), kCellCube);
}

TEST(CurveKey, TablesFollowTheDefinition) {
  // All cells of the first levels at both ends of the deeper ones
  for (std::uint32_t x = 0; x < 32; ++x) {
    for (std::uint32_t y = 0; y < 32; ++y) {
      for (std::uint32_t z = 0; z < 32; ++z) {
        ASSERT_EQ(keyAt(x, y, z), curveKey(x, y, z));
        ASSERT_EQ(keyAt(x << 16, y << 16, z << 16), curveKey(x << 16, y << 16, z << 16));
        const std::uint32_t a = (x << 16) + 0xffff, b = (y << 16) + 0xffff, c = (z << 16) + 0xffff;
        ASSERT_EQ(keyAt(a, b, c), curveKey(a, b, c));
      }
    }
  }
  // Every orientation at every level
  std::mt19937 random(4);
  for (int i = 0; i < 300000; ++i) {
    const std::uint32_t x = random() >> 11, y = random() >> 11, z = random() >> 11;
    ASSERT_EQ(keyAt(x, y, z), curveKey(x, y, z));
  }
}

// The key as it follows from the definition, position by position.
CurveKey keyByDefinition(const glm::vec3& position, const RootCube& cube) {
  std::uint32_t cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (double(position[axis]) - cube.origin[axis]) / cube.size * double(1u << 21);
    cell[axis] =
        static_cast<std::uint32_t>(std::floor(std::clamp(at, 0.0, double((1u << 21) - 1))));
  }
  return curveKey(cell[0], cell[1], cell[2]);
}

TEST(CurveKey, BatchesGiveTheKeysOfSinglePositions) {
  struct Record {
    std::uint32_t before;
    glm::vec3 position;
    std::uint16_t after;
  };
  const float huge = std::numeric_limits<float>::max();
  const float tiny = std::numeric_limits<float>::denorm_min();
  std::mt19937 random(5);
  for (const RootCube& cube : {RootCube{}, RootCube{{-1000, 3, 1e6}, 0.7}, kCellCube,
                               RootCube{{-1e12, -1e12, -1e12}, 2e12}, RootCube{{5, 5, 5}, 1e-30}}) {
    // Borders of cells, corners of the cube and far beyond, then positions inside and around
    std::vector<Record> records;
    const auto add = [&](float x, float y, float z) { records.push_back({0, {x, y, z}, 0}); };
    for (const float value : {0.f, -0.f, tiny, -tiny, 1.f, huge, -huge, 1e12f, -1e12f}) {
      add(value, 0, 0);
      add(0, value, value);
      add(value, value, value);
    }
    for (int i = 0; i < 5000; ++i) {
      float at[3];
      for (int axis = 0; axis < 3; ++axis) {
        const double part = i % 2 == 0 ? double(random() % 65) / 64
                                       : 1.2 * double(random()) / std::pow(2.0, 32) - 0.1;
        at[axis] = float(cube.origin[axis] + part * cube.size);
        if (i % 3 == 0) at[axis] = std::nextafter(at[axis], random() % 2 == 0 ? huge : -huge);
      }
      add(at[0], at[1], at[2]);
    }
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{63},
                                    std::size_t{64}, std::size_t{65}, records.size()}) {
      std::vector<CurveKey> keys(count + 1, 77);
      curveKeys(&records[0].position, sizeof(Record), cube, std::span(keys).first(count));
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ(keys[i], keyByDefinition(records[i].position, cube));
        ASSERT_EQ(keys[i], curveKey(records[i].position, cube));
      }
      ASSERT_EQ(keys[count], 77u);
    }
  }
}

}  // namespace
}  // namespace surfeit
