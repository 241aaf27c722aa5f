#include "sample/dice.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <set>

#include "sample/scene_files.h"

namespace surfeit {
namespace {

double area(const Micropolygon& polygon) {
  return 0.5 * glm::length(glm::cross(polygon.corner[1] - polygon.corner[0],
                                      polygon.corner[2] - polygon.corner[0]));
}

Mesh triangleMesh(const std::vector<glm::vec3>& corners) {
  Mesh mesh;
  mesh.position = corners;
  for (std::uint32_t i = 0; i + 2 < corners.size(); i += 3) {
    mesh.triangle.emplace_back(i, i + 1, i + 2);
    mesh.triangle_material.push_back(0);
  }
  mesh.materials.emplace_back();
  return mesh;
}

TEST(Dice, PiecesHaveEqualAreaAndTileTheTriangle) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {3, 0, 1}, {1, 2, 0}});
  const Micropolygon whole = wholeTriangle(mesh, 0);
  for (const std::uint64_t count : {1, 2, 3, 7, 64, 1000}) {
    for (std::uint64_t i = 0; i < count; ++i) {
      const Micropolygon part = piece(whole, count, i);
      ASSERT_NEAR(area(part) * double(count) / area(whole), 1, 1e-9);
      for (int k = 0; k < 3; ++k) {
        // The weights say where the corners are
        const glm::dvec3 from_weights = part.weight[k].x * whole.corner[0] +
                                        part.weight[k].y * whole.corner[1] +
                                        part.weight[k].z * whole.corner[2];
        ASSERT_NEAR(glm::distance(from_weights, part.corner[k]), 0, 1e-12);
      }
    }
  }
}

TEST(Dice, PiecesOfARoundTriangleStayRound) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {1, 0, 0}, {0.5f, 0.866f, 0}});
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const Micropolygon part = piece(wholeTriangle(mesh, 0), 1000, i);
    ASSERT_LT(part.radius(), 2 * std::sqrt(area(part)));
  }
}

TEST(Dice, NearPieceIsTheOneThatHoldsItsCentroid) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {3, 0, 1}, {1, 2, 0}});
  const Micropolygon whole = wholeTriangle(mesh, 0);
  for (std::uint64_t i = 0; i < 64; ++i) {
    const std::uint64_t near = pieceNear(whole, 64, piece(whole, 64, i).centroid());
    ASSERT_LT(glm::distance(piece(whole, 64, near).centroid(), piece(whole, 64, i).centroid()),
              2 * piece(whole, 64, i).radius());
  }
}

TEST(Dice, SliversAreCutUntilTheirDisksAreSmall) {
  for (const float apex : {0.0f, 3.3f, 5.0f, 10.0f}) {
    const Mesh mesh = triangleMesh({{0, 0, 0}, {10, 0, 0}, {apex, 0.01f, 0}});
    const Micropolygon whole = wholeTriangle(mesh, 0);
    std::vector<PiecePart> parts;
    appendParts(whole, area(whole), 0.2, parts);
    EXPECT_LE(parts.size(), 26u);
    double sum = 0;
    glm::dvec3 moment(0);
    for (const PiecePart& part : parts) {
      EXPECT_LE(part.radius, 1.5 * 0.2);
      EXPECT_GT(part.area, 0);
      EXPECT_NEAR(part.weight.x + part.weight.y + part.weight.z, 1, 1e-12);
      EXPECT_NEAR(part.weight.y * 10 + part.weight.z * double(apex), part.centroid.x, 1e-9);
      sum += part.area;
      moment += part.area * part.centroid;
    }
    EXPECT_NEAR(sum / area(whole), 1, 1e-12);
    EXPECT_NEAR(glm::distance(moment / sum, whole.centroid()), 0, 1e-9);
  }
}

// Of all pieces of a triangle.
std::vector<PiecePart> allParts(const TriangleDice& dice, std::uint64_t piece_count) {
  std::vector<PiecePart> parts;
  for (std::uint64_t i = 0; i < piece_count; ++i) dice.appendParts(i, parts);
  return parts;
}

std::uint64_t pieceCount(double area, double spacing) {
  return std::uint64_t(std::max(1.0, std::ceil(area / (spacing * spacing))));
}

TEST(TriangleDice, PartsOfAStripTileIt) {
  constexpr double kSpacing = 0.1;
  for (const float apex : {0.0f, 3.3f, 10.0f}) {
    for (const float height : {0.003f, 0.09f, 0.11f, 0.34f, 1.2f}) {
      const Mesh mesh = triangleMesh({{0, 0, 0}, {10, 0, 0}, {apex, height, 0}});
      const Micropolygon whole = wholeTriangle(mesh, 0);
      const std::uint64_t count = pieceCount(area(whole), kSpacing);
      const TriangleDice dice(whole, area(whole), count, kSpacing);
      const std::vector<PiecePart> parts = allParts(dice, count);
      EXPECT_GE(parts.size(), count);
      EXPECT_LE(parts.size(), 2 * count + 100);  // 2 spacings long or as large as a square of it
      double sum = 0;
      glm::dvec3 moment(0);
      for (const PiecePart& part : parts) {
        EXPECT_LE(part.radius, 1.5 * kSpacing);
        EXPECT_GT(part.area, 0);
        EXPECT_NEAR(part.weight.x + part.weight.y + part.weight.z, 1, 1e-12);
        sum += part.area;
        moment += part.area * part.centroid;

        std::vector<PiecePart> near;
        dice.appendParts(dice.pieceNear(part.centroid), near);
        double distance = 1e30;
        for (const PiecePart& other : near) {
          distance = std::min(distance, glm::distance(other.centroid, part.centroid));
        }
        ASSERT_LT(distance, 0.1 * kSpacing);
      }
      EXPECT_NEAR(sum / area(whole), 1, 1e-12);
      EXPECT_NEAR(glm::distance(moment / sum, whole.centroid()), 0, 1e-9);
    }
  }
}

// Whether a place lies in the rectangle of a part.
bool isInRectangle(const PiecePart& part, const glm::dvec3& place) {
  const double length = glm::length(part.long_side), width = part.area / length;
  const glm::dvec3 off = place - part.centroid;
  const double along = glm::dot(off, part.long_side) / length;
  const double across = std::sqrt(std::max(0.0, glm::dot(off, off) - along * along));
  return std::abs(along) <= 0.5 * length && across <= 0.5 * width;
}

// A ribbon of two triangles, of which the parts are drawn as rectangles: they lie side by side.
// (Those of the needles that piece() cuts cover .90, .89 and .87 of it.)
TEST(TriangleDice, RectanglesCoverARibbon) {
  const Mesh mesh =
      triangleMesh({{0, 0, 0}, {5, 0, 0}, {5, 0.1f, 0}, {0, 0, 0}, {5, 0.1f, 0}, {0, 0.1f, 0}});
  for (const double spacing : {0.14, 0.06, 0.02}) {
    std::vector<PiecePart> parts;
    for (const std::uint32_t triangle : {0u, 1u}) {
      const Micropolygon whole = wholeTriangle(mesh, triangle);
      const std::uint64_t count = pieceCount(area(whole), spacing);
      const TriangleDice dice(whole, area(whole), count, spacing);
      for (const PiecePart& part : allParts(dice, count)) parts.push_back(part);
    }
    int covered = 0, places = 0;
    for (int i = 0; i < 1000; ++i) {
      for (int j = 0; j < 20; ++j, ++places) {
        const glm::dvec3 place((i + 0.5) * 5 / 1000, (j + 0.5) * 0.1 / 20, 0);
        covered += std::any_of(parts.begin(), parts.end(),
                               [&](const PiecePart& part) { return isInRectangle(part, place); });
      }
    }
    EXPECT_GT(covered, 0.97 * places) << spacing;
  }
}

// And none is longer than wide by more than the ribbon is.
TEST(TriangleDice, LongSidesLieAlongARibbon) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {4, 0, 0}, {4, 0.1f, 0}});
  const Micropolygon whole = wholeTriangle(mesh, 0);
  const std::vector<PiecePart> parts = allParts(TriangleDice(whole, area(whole), 20, 0.1), 20);
  ASSERT_GT(parts.size(), 10u);
  for (const PiecePart& part : parts) {
    const double length = glm::length(part.long_side);
    EXPECT_GE(length * length, part.area * (1 - 1e-9));
    EXPECT_LT(length, 2 * part.radius);
    if (length * length < 2 * part.area) continue;
    EXPECT_GT(std::abs(part.long_side.x), 0.99 * length);
  }
}

TEST(Dice, LongSideOfARightTriangleSpreadsAsItDoes) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  std::vector<PiecePart> parts;
  appendParts(wholeTriangle(mesh, 0), 0.5, 1, parts);
  ASSERT_EQ(parts.size(), 1u);
  // Along the hypotenuse h its variance is h^2 / 24, that of a rectangle length^2 / 12
  EXPECT_NEAR(glm::length(parts[0].long_side), 1, 1e-12);
  EXPECT_NEAR(parts[0].long_side.x, -parts[0].long_side.y, 1e-12);
}

TEST(Dice, NoSliverGivesUnboundedParts) {
  const Mesh mesh = triangleMesh({{0, 0, 0}, {1e6f, 0, 0}, {5, 0.01f, 0}});
  std::vector<PiecePart> parts;
  appendParts(wholeTriangle(mesh, 0), 5000, 1e-3, parts);
  EXPECT_EQ(parts.size(), std::size_t(kMaxSlabs));
}

TEST(DicePlan, CountsAddUpAndEveryTriangleIsCarriedOnce) {
  // Triangles of very different area
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<glm::vec3> corners;
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 at(unit(random), unit(random), unit(random));
    const float size = std::pow(unit(random), 6.0f) * 0.2f + 1e-4f;
    for (int k = 0; k < 3; ++k) {
      corners.push_back(at + size * glm::vec3(unit(random), unit(random), unit(random)));
    }
  }
  const Mesh mesh = triangleMesh(corners);
  for (const std::uint64_t count : {1, 2, 17, 500, 12345}) {
    DicePlan plan(mesh, count);
    std::uint64_t pieces = 0;
    double summed_area = 0;
    std::set<std::uint32_t> seen;
    DiceJob job;
    while (plan.next(job)) {
      EXPECT_EQ(job.first_surfel, pieces);
      EXPECT_LE(std::abs(double(job.piece_count) - job.area / plan.totalArea() * double(count)),
                1.0);
      pieces += job.piece_count;
      EXPECT_TRUE(seen.insert(job.triangle).second);
      summed_area += job.area;
      for (const std::uint32_t triangle : job.carried) {
        EXPECT_TRUE(seen.insert(triangle).second);
        summed_area += triangleArea(mesh, triangle);
      }
    }
    EXPECT_EQ(pieces, count);
    EXPECT_EQ(seen.size(), mesh.triangle.size());
    EXPECT_NEAR(summed_area / plan.totalArea(), 1, 1e-12);
  }
}

}  // namespace
}  // namespace surfeit
