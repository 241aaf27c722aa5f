#include "sample/meshes/polygon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

namespace surfeit {
namespace {

using Corners = std::vector<glm::dvec3>;

struct Cut {
  bool is_simple = false;
  double area = 0;       // of all triangles
  glm::dvec3 across{0};  // half the sum of their cross products
  bool is_of_one_side = true;
};

Cut cut(const Corners& corners) {
  std::vector<glm::uvec3> triangles;
  Cut cut;
  cut.is_simple = cutPolygon(corners, triangles);
  for (const glm::uvec3& t : triangles) {
    const glm::dvec3 cross =
        0.5 * glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]);
    cut.area += glm::length(cross);
    cut.is_of_one_side = cut.is_of_one_side && glm::dot(cut.across, cross) >= 0;
    cut.across += cross;
  }
  return cut;
}

// What the outline alone says.
double outlineArea(const Corners& corners) {
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    sum += glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
  }
  return 0.5 * glm::length(sum);
}

// Beginning anywhere, seen from both sides, turned in space and far away.
void expectCovered(const Corners& corners, double area) {
  for (std::size_t first = 0; first < corners.size(); ++first) {
    for (const bool is_reversed : {false, true}) {
      Corners turned;
      for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3& p = corners[(i + first) % corners.size()];
        turned.emplace_back(1000 + .6 * p.x - .8 * p.z, 2000 + p.y, .8 * p.x + .6 * p.z);
      }
      if (is_reversed) std::reverse(turned.begin(), turned.end());
      const Cut found = cut(turned);
      EXPECT_TRUE(found.is_simple) << "from corner " << first;
      EXPECT_TRUE(found.is_of_one_side) << "from corner " << first;
      EXPECT_NEAR(found.area, area, 1e-8 * area) << "from corner " << first;
      EXPECT_NEAR(glm::length(found.across), area, 1e-8 * area);
      EXPECT_GT(glm::dot(found.across, glm::dvec3(-.8, 0, .6)) * (is_reversed ? -1 : 1), 0);
    }
  }
}

TEST(Polygon, ConvexOnesBecomeTheFanOfTheirFirstCorner) {
  std::vector<glm::uvec3> triangles;
  EXPECT_TRUE(cutPolygon(Corners{{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}}, triangles));
  EXPECT_EQ(triangles, (std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Polygon, ConcaveOnesAreCoveredOnce) {
  expectCovered({{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {2, 1, 0}, {0, 4, 0}}, 10);
  // U, L, and an arrow
  expectCovered(
      {{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}}, 7);
  expectCovered({{0, 0, 0}, {3, 0, 0}, {3, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}}, 5);
  expectCovered({{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1, 1, 0}}, 1);
}

TEST(Polygon, CornersOnALineAndTwiceCostNothing) {
  expectCovered(
      {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 1, 0}, {0, 2, 0}, {0, 1, 0}}, 3);
}

TEST(Polygon, AHoleJoinedToItsOutlineStaysOpen) {
  // A square of 4 with a hole of 2, joined by the edge from (0, 0) to (1, 1), there and back
  expectCovered({{0, 0, 0},
                 {4, 0, 0},
                 {4, 4, 0},
                 {0, 4, 0},
                 {0, 0, 0},
                 {1, 1, 0},
                 {1, 3, 0},
                 {3, 3, 0},
                 {3, 1, 0},
                 {1, 1, 0}},
                12);
}

TEST(Polygon, RandomStarsAndCombsAreCoveredOnce) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int run = 0; run < 200; ++run) {
    Corners star;
    const int count = 5 + int(random() % 60);
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * 3.14159265358979 * (i + .8 * unit(random)) / count;
      const double r = .05 + unit(random);
      star.emplace_back(r * std::cos(angle), r * std::sin(angle), 0);
    }
    const Cut found = cut(star);
    EXPECT_TRUE(found.is_simple) << run;
    EXPECT_NEAR(found.area, outlineArea(star), 1e-9) << run;
  }
  Corners comb;
  for (int i = 0; i < 2000; ++i) comb.emplace_back(i, i % 2 == 0 ? 10. : 1 + unit(random), 0);
  comb.emplace_back(1999, 0, 0);
  comb.emplace_back(0, 0, 0);
  const Cut found = cut(comb);
  EXPECT_TRUE(found.is_simple);
  EXPECT_NEAR(found.area, outlineArea(comb), 1e-8 * found.area);
}

TEST(Polygon, CrossingEdgesAreSaid) {
  EXPECT_FALSE(cut({{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 2, 0}, {-1, 1, 0}}).is_simple);
}

}  // namespace
}  // namespace surfeit
