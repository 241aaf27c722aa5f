// Root cubes, and the origins that clouds are counted from.
#include "core/bounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace surfeit {
namespace {

Bounds3d boxOf(const glm::dvec3& corner, const glm::dvec3& sides) {
  return {corner, corner + sides};
}

// Boxes of any size and place, and such as people build.
std::vector<Bounds3d> someBoxes() {
  std::vector<Bounds3d> boxes = {boxOf({0, 0, 0}, {1, 1, 1}), boxOf({-5, -5, 0}, {10, 10, 3}),
                                 boxOf({-.5, 0, -.5}, {1, 1, 1}), boxOf({2, 2, 2}, {0, 0, 0}),
                                 boxOf({5e5, 4e6, 100}, {1000, 1000, 50})};
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 1000; ++i) {
    const double scale = std::pow(10, 8 * unit(random) - 4);
    const glm::dvec3 corner(unit(random) - .5, unit(random) - .5, unit(random) - .5);
    boxes.push_back(boxOf(4 * scale * corner, scale * glm::dvec3(unit(random), unit(random), 1)));
  }
  return boxes;
}

TEST(RootCube, HoldsItsBox) {
  for (const Bounds3d& box : someBoxes()) {
    const RootCube cube = rootCube(box);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(cube.origin[axis], box.min[axis]);
      EXPECT_GE(cube.origin[axis] + cube.size, box.max[axis]);
    }
    EXPECT_LE(cube.size, box.longestSide() > 0 ? 4 * box.longestSide() : 1);
  }
}

// A floor at a round number, with noise, is within one layer of cells or near the middle of it.
TEST(RootCube, BordersOfCellsLieBesideRoundNumbers) {
  for (const Bounds3d& box : someBoxes()) {
    const RootCube cube = rootCube(box);
    for (int level = 4; level <= 17; ++level) {
      const double cell = std::ldexp(cube.size, -level);
      for (int axis = 0; axis < 3; ++axis) {
        for (int step = 0; step < 16; ++step) {
          const double round = (std::floor(box.min[axis] / cube.size * 16) + step) * cube.size / 16;
          const double cells = (round - cube.origin[axis]) / cell;
          EXPECT_GE(std::abs(cells - std::round(cells)), .24) << level << ' ' << round;
        }
      }
    }
  }
}

// A sample of a cloud reaches a little less far, and has its cube but for one in eight.
TEST(RootCube, IsThatOfASample) {
  int others = 0, count = 0;
  for (const Bounds3d& box : someBoxes()) {
    const glm::dvec3 lost = .001 * (box.max - box.min);
    others += rootCube(Bounds3d{box.min + lost, box.max - lost}) == rootCube(box) ? 0 : 1;
    ++count;
  }
  EXPECT_LT(others, count / 8);
}

// Clouds on a map keep every digit wherever they lie.
TEST(OriginFor, IsRoundAndMovesWithTheCloud) {
  for (const Bounds3d& box : someBoxes()) {
    const double size = cubeSize(box);
    const glm::dvec3 origin = originFor(box);
    for (int axis = 0; axis < 3; ++axis) {
      const double steps = origin[axis] / (size / 16);
      EXPECT_EQ(steps, std::round(steps));
      EXPECT_LT(std::abs(box.min[axis] - origin[axis]), 4 * size);
    }
    const glm::dvec3 by = 1024 * size * glm::dvec3(1, -2, 3);
    const Bounds3d moved = {box.min + by, box.max + by}, again = {moved.min + by, moved.max + by};
    EXPECT_EQ(originFor(again) - originFor(moved), by);
  }
}

}  // namespace
}  // namespace surfeit
