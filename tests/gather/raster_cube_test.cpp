#include "gather/scalar/raster_cube.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <random>
#include <vector>

#include "core/spherical_harmonics.h"
#include "gather/rules/coverage_rules.h"

namespace surfeit {
namespace {

constexpr glm::vec3 kRound{0};  // the normal of what looks the same from everywhere
constexpr glm::vec3 kWhite{1};
constexpr DepthRange kDepth{1, 1};

RasterCube::Patch diskPatch(const glm::vec3& direction, const glm::vec3& normal, float solid_angle,
                            float spread = 0, float overlap = 0) {
  return {direction, normal, withoutDirection(normal), solid_angle, spread, overlap};
}

// Covered solid angle of the whole cube.
double coveredSolidAngle(const RasterCube& cube) {
  double sum = 0;
  for (std::size_t i = 0; i < cube.geometry().pixels().size(); ++i) {
    sum += double(cube.coverage(i)) * double(cube.geometry().pixels()[i].solid_angle);
  }
  return sum;
}

// Directions all around, with some on edges and corners of the cube and some close to them.
std::vector<glm::vec3> testDirections() {
  std::vector<glm::vec3> directions = {{1, 1, 0},   {1, 0, -1},   {0, -1, 1},      {1, 1, 1},
                                       {-1, 1, -1}, {1, .98f, 0}, {.97f, 1, -.9f}, {0, 0, 1}};
  constexpr int kCount = 400;
  for (int i = 0; i < kCount; ++i) {
    const float z = 1 - float(2 * i + 1) / kCount, phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    directions.push_back({rho * std::cos(phi), rho * std::sin(phi), z});
  }
  for (glm::vec3& direction : directions) direction = glm::normalize(direction);
  return directions;
}

TEST(RasterGeometry, SolidAnglesSumToTheSphere) {
  for (int resolution = 2; resolution <= 64; resolution += 2) {
    const RasterGeometry geometry(resolution);
    ASSERT_EQ(geometry.pixels().size(), RasterGeometry::pixelCount(resolution));
    double sum = 0;
    for (const RasterGeometry::Pixel& pixel : geometry.pixels()) sum += double(pixel.solid_angle);
    EXPECT_NEAR(sum, 4 * double(kPi), 1e-5) << resolution;
  }
}

TEST(RasterGeometry, DirectionsAreUnitAndBalanced) {
  const RasterGeometry geometry(12);
  glm::vec3 sum(0);
  for (const RasterGeometry::Pixel& pixel : geometry.pixels()) {
    EXPECT_NEAR(glm::length(pixel.direction), 1, 1e-6);
    sum += pixel.solid_angle * pixel.direction;
  }
  EXPECT_LT(glm::length(sum), 1e-5f);
}

TEST(RasterGeometry, OnlyEvenResolutionsWithinLimitsAreValid) {
  EXPECT_TRUE(RasterGeometry::isValidResolution(2));
  EXPECT_TRUE(RasterGeometry::isValidResolution(64));
  for (const int resolution : {-2, 0, 1, 13, 66}) {
    EXPECT_FALSE(RasterGeometry::isValidResolution(resolution)) << resolution;
  }
}

TEST(RasterCube, SplatKeepsItsSolidAngleEverywhere) {
  for (const int resolution : {12, 32, 64}) {
    const RasterGeometry geometry(resolution);
    RasterCube cube(geometry, false);
    for (const glm::vec3& direction : testDirections()) {
      for (const float solid_angle : {1e-4f, .01f, .05f}) {
        cube.clear();
        cube.splat(diskPatch(direction, kRound, solid_angle, solid_angle), kDepth, kWhite);
        // What spills over an edge is drawn as a rectangle instead of a trapezoid, the part of a
        // pixel that is covered is measured on the face, and pixels nearly full are filled
        const double tolerance = resolution == 12 ? .18 : .10;
        EXPECT_NEAR(coveredSolidAngle(cube) / double(solid_angle), 1, tolerance)
            << resolution << ": " << direction.x << " " << direction.y << " " << direction.z;
      }
    }
  }
}

TEST(RasterCube, SplatsOfAllDirectionsConserveSolidAngleOnAverage) {
  const RasterGeometry geometry(12);
  RasterCube cube(geometry, false);
  double ratio = 0;
  for (const glm::vec3& direction : testDirections()) {
    cube.clear();
    cube.splat(diskPatch(direction, kRound, 2e-4f), kDepth, kWhite);
    ratio += coveredSolidAngle(cube) / 2e-4;
  }
  EXPECT_NEAR(ratio / double(testDirections().size()), 1, .01);
}

TEST(RasterCube, SplatOfSlantedDiskFollowsItsShape) {
  const RasterGeometry geometry(64);
  RasterCube cube(geometry, false);
  // Seen from straight below, a disk leaning in z is narrow in z and wide in y on the +x face
  cube.splat(diskPatch({1, 0, 0}, glm::normalize(glm::vec3(-.3f, 0, 1)), .01f), kDepth, kWhite);
  int columns = 0, rows = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    columns += cube.coverage(32 * 64 + i) > 0;
    rows += cube.coverage(i * 64 + 32) > 0;
  }
  EXPECT_GT(columns, 2 * rows);
}

TEST(RasterCube, TracedDiskHasItsAnalyticSolidAngle) {
  const RasterGeometry geometry(64);
  RasterCube cube(geometry, false);
  for (const glm::vec3& direction : testDirections()) {
    for (const float distance : {.2f, 1.f, 3.f}) {
      cube.clear();
      cube.traceDisk(distance * direction, direction, 1, RasterCube::kHardDisk, {}, kDepth, kWhite);
      const double expected =
          2 * double(kPi) *
          (1 - double(distance) / std::sqrt(1 + double(distance) * double(distance)));
      EXPECT_NEAR(coveredSolidAngle(cube) / expected, 1, .035);
    }
  }
}

TEST(RasterCube, TracedDiskAcrossTheOriginCoversHalfTheSphere) {
  const RasterGeometry geometry(16);
  RasterCube cube(geometry, false);
  const glm::vec3 normal = glm::normalize(glm::vec3(1, 2, 3));
  cube.traceDisk(1e-4f * normal, normal, 100, RasterCube::kHardDisk, {}, kDepth, kWhite);
  EXPECT_NEAR(coveredSolidAngle(cube), 2 * double(kPi), .06);
}

TEST(RasterCube, TracedSphereHasItsAnalyticSolidAngle) {
  const RasterGeometry geometry(64);
  RasterCube cube(geometry, false);
  for (const glm::vec3& direction : testDirections()) {
    for (const float distance : {1.001f, 1.5f, 4.f}) {
      cube.clear();
      cube.traceSphere(distance * direction, 1, {}, kDepth, kWhite);
      const double sine = 1 / double(distance);
      const double expected = 2 * double(kPi) * (1 - std::sqrt(1 - sine * sine));
      EXPECT_NEAR(coveredSolidAngle(cube) / expected, 1, .035);
    }
  }
}

TEST(RasterCube, CoverageAddsWithinALayerAndNeverExceedsOne) {
  const RasterGeometry geometry(12);
  RasterCube cube(geometry, true);
  for (int i = 0; i < 1000; ++i) {
    for (const glm::vec3& direction : testDirections()) {
      const DepthRange depth = {1 + float(i) / 100, 1 + float(i + 7) / 100};
      cube.splat(diskPatch(direction, kRound, .06f), depth, kWhite);
    }
  }
  for (std::size_t i = 0; i < geometry.pixels().size(); ++i) {
    ASSERT_EQ(cube.coverage(i), 1) << i;
    ASSERT_NEAR(cube.radiosity(i).x, 1, 1e-5);
  }
}

TEST(RasterCube, LayersCoverEachOtherInsteadOfAdding) {
  const RasterGeometry geometry(2);  // one pixel is a quarter of a face
  RasterCube cube(geometry, true);
  const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f, .5f));
  const float axis_cubed = direction.x * direction.x * direction.x;
  const auto splatHalf = [&](DepthRange depth, const glm::vec3& radiosity) {
    cube.splat(diskPatch(direction, kRound, .5f * axis_cubed), depth, radiosity);
  };
  const std::size_t pixel = 3;

  splatHalf({1, 2}, {1, 0, 0});
  EXPECT_NEAR(cube.coverage(pixel), .5f, 1e-5);
  splatHalf({3, 4}, {0, 1, 0});  // half of what is left
  EXPECT_NEAR(cube.coverage(pixel), .75f, 1e-5);
  EXPECT_NEAR(cube.radiosity(pixel).x, .5f, 1e-5);
  EXPECT_NEAR(cube.radiosity(pixel).y, .25f, 1e-5);

  cube.clear();
  splatHalf({1, 2}, {1, 0, 0});
  splatHalf({1.5f, 2.5f}, {0, 1, 0});  // the same layer
  EXPECT_NEAR(cube.coverage(pixel), 1, 1e-5);
  EXPECT_NEAR(cube.radiosity(pixel).y, .5f, 1e-5);
}

TEST(RasterCube, LayersBeginByAndBy) {
  const RasterGeometry geometry(2);
  RasterCube cube(geometry, false);
  const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f, .5f));
  const RasterCube::Patch half =
      diskPatch(direction, kRound, .5f * direction.x * direction.x * direction.x);
  const auto covered = [&](float gap) {
    cube.clear();
    cube.splat(half, {1, 2}, kWhite);
    cube.splat(half, {2 + gap, 3 + gap}, kWhite);
    return cube.coverage(3);
  };
  EXPECT_NEAR(covered(-.1f), 1, 1e-5);
  EXPECT_NEAR(covered(.5f * kFidelity.layer_gap), .75f, 1e-5);  // half of the range is its reach
  float before = 1;
  for (float gap = 0; gap < .6f * kFidelity.layer_gap; gap += .01f * kFidelity.layer_gap) {
    const float now = covered(gap);
    EXPECT_LE(now, before + 1e-5f) << gap;
    EXPECT_GT(now, before - .02f) << gap;
    before = now;
  }
}

TEST(RasterCube, WhatHardlyTouchesAPixelHardlyChangesIt) {
  const RasterGeometry geometry(4);
  RasterCube cube(geometry, false);
  // All in pixels of the face +x
  const auto square = [&](float column, float row, float side, const DepthRange& depth) {
    const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f * column - 1, .5f * row - 1));
    const float area = .25f * side * side;
    cube.splat(diskPatch(direction, {-1, 0, 0}, area * direction.x * direction.x * direction.x),
               depth, kWhite);
  };
  // Something deep beside the pixel laps over it, between two of different layers
  const auto covered = [&](float lap) {
    cube.clear();
    square(1.5f, 1.5f, .7f, {1, 2});
    square(2.5f - lap, 1.5f, 1, {1.5f, 9});
    square(1.5f, 1.5f, .7f, {3, 4});
    return cube.coverage(1 * 4 + 1);
  };
  const float apart = covered(0);
  EXPECT_NEAR(apart, .49f + .51f * .49f, 1e-4);
  EXPECT_NEAR(covered(1e-4f), apart, .005f);
  EXPECT_NEAR(covered(1e-3f), apart, .05f);
  EXPECT_GT(covered(.1f), .97f) << "now they are of one layer";
}

TEST(RasterCube, WhatIsNestedHidesBehindTheLargerLayer) {
  const RasterGeometry geometry(2);
  RasterCube cube(geometry, false);
  const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f, .5f));
  const float axis_cubed = direction.x * direction.x * direction.x;
  const auto cover = [&](float amount, float depth, float nested) {
    RasterCube::Patch patch = diskPatch(direction, kRound, amount * axis_cubed);
    patch.texture.nested = nested;
    cube.splat(patch, {depth, depth + .5f}, kWhite);
    return double(cube.coverage(3));
  };
  for (const float nested : {0.f, .4f, 1.f}) {
    const double apart = 1 - double(nested);
    cube.clear();
    EXPECT_NEAR(cover(.5f, 1, nested), .5, 1e-5) << "nothing is before the first layer";
    EXPECT_NEAR(cover(.3f, 2, nested), .5 + apart * .15, 1e-5) << "the smaller lies behind";
    cube.clear();
    cover(.3f, 1, nested);
    EXPECT_NEAR(cover(.5f, 2, nested), .5 + apart * .15, 1e-5) << "the larger rises above";
    EXPECT_NEAR(cover(1.5f, 3, nested), 1, 1e-6) << "what fills the pixel fills all that was open";
  }
  // Of one layer, what is nested adds nothing to more than it would cover with all before it
  cube.clear();
  cover(.5f, 1, 0);
  const double anywhere = cover(.5f, 2, 0);
  EXPECT_NEAR(anywhere, .75, 1e-5);
  EXPECT_NEAR(cover(.1f, 2, 1), anywhere, 1e-5);
}

// A sheet of disks that face the cube at x = `distance`, on the face +x of 16 pixels: squares of
// `side` pixels, scattered by a part of that, within a square of `half` pixels around the middle.
struct SheetOfDisks {
  float distance = 1, side = .8f, scatter = .3f, half = 8;
  bool is_solid = true;
  float thicket = 0;

  void drawTo(RasterCube& cube, const glm::vec3& radiosity) const {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const float step = side * distance / 8;
    const int count = int(2 * half / side);
    for (int i = 0; i < count * count; ++i) {
      const float u =
          (float(i % count) + .5f + scatter * uniform(random)) * step - half * distance / 8;
      const float v =
          (float(i / count) + .5f + scatter * uniform(random)) * step - half * distance / 8;
      const glm::vec3 to(distance, u, v), direction = glm::normalize(to);
      const float length_sq = glm::dot(to, to);
      RasterCube::Patch patch =
          diskPatch(direction, {-1, 0, 0}, step * step * direction.x / length_sq);
      patch.texture.is_solid = is_solid;
      patch.texture.thicket = thicket;
      cube.splat(patch, {.99f * distance, 1.01f * distance}, radiosity);
    }
  }
};

class Closing : public ::testing::Test {
 protected:
  // Mean of the light, and of what is covered, of pixels in the middle of the face.
  glm::vec2 seen(int half) const {
    glm::vec2 sum(0);
    for (int row = 8 - half; row < 8 + half; ++row) {
      for (int column = 8 - half; column < 8 + half; ++column) {
        const auto pixel = std::size_t(row * 16 + column);
        sum += glm::vec2(cube_.radiosity(pixel).x, cube_.coverage(pixel));
      }
    }
    return sum / float(4 * half * half);
  }
  const glm::vec3 dark_{0};
  RasterGeometry geometry_{16};
  RasterCube cube_{geometry_, true};
};

TEST_F(Closing, NothingShinesThroughTheGapsOfASheet) {
  for (const float side : {.1f, .3f, .8f, 1.7f}) {
    cube_.clear();
    SheetOfDisks{.side = side}.drawTo(cube_, dark_);
    ASSERT_LT(seen(4).y, .999f) << side;  // gaps
    SheetOfDisks{.distance = 3}.drawTo(cube_, kWhite);
    cube_.close();
    EXPECT_LT(seen(4).x, .003f) << side;
    EXPECT_NEAR(seen(4).y, 1, .003f) << side;
  }
}

TEST_F(Closing, WhatIsClosedShinesAsItsOwnLayerDoes) {
  SheetOfDisks{}.drawTo(cube_, kWhite);
  SheetOfDisks{.distance = 3}.drawTo(cube_, dark_);
  cube_.close();
  EXPECT_NEAR(seen(4).x, 1, .003f);
}

// The sheet covers a square of 6 by 6 pixels, and a part of those around.
TEST_F(Closing, OutlinesStayWhereTheyAre) {
  SheetOfDisks{.side = .5f, .scatter = 0, .half = 3.25f}.drawTo(cube_, dark_);
  const float before = seen(8).y;
  cube_.close();
  EXPECT_NEAR(seen(8).y, before, .01f * before);
  EXPECT_NEAR(before * 256, 6.5f * 6.5f, .8f);
}

TEST_F(Closing, GapsBetweenLeavesAndBetweenSpheresStayOpen) {
  for (const bool is_thicket : {false, true}) {
    cube_.clear();
    SheetOfDisks{.scatter = 1.5f, .is_solid = is_thicket, .thicket = is_thicket ? 1.f : 0.f}.drawTo(
        cube_, kWhite);
    const float before = seen(8).y;
    cube_.close();
    EXPECT_NEAR(seen(8).y, before, is_thicket ? 1e-6f : .02f) << is_thicket;
  }
}

// Of less than a pixel, before a wall: it sends what its area says, wherever it is.
TEST_F(Closing, SmallThingsKeepTheirPower) {
  SheetOfDisks wall{.distance = 3};
  double sum = 0;
  constexpr int kPlaces = 400;
  for (int i = 0; i < kPlaces; ++i) {
    cube_.clear();
    const glm::vec3 direction =
        glm::normalize(glm::vec3(1, .013f * float(i % 20), .017f * float(i / 20)));
    const float solid_angle = .1f * 4 / 256;
    RasterCube::Patch lamp = diskPatch(direction, kRound, solid_angle);
    lamp.texture.is_solid = false;
    cube_.splat(lamp, {.999f, 1.001f}, kWhite);
    wall.drawTo(cube_, dark_);
    cube_.close();
    double power = 0;
    for (std::size_t pixel = 0; pixel < 256; ++pixel) {
      power += double(cube_.radiosity(pixel).x * geometry_.pixels()[pixel].solid_angle);
    }
    sum += power / double(solid_angle) / kPlaces;
  }
  EXPECT_NEAR(sum, 1, .01);
}

TEST(RasterCube, WhatOverlapsHidesBehindItsOwnLayer) {
  const RasterGeometry geometry(2);
  RasterCube cube(geometry, false);
  const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f, .5f));
  const float axis_cubed = direction.x * direction.x * direction.x;
  const auto cover = [&](float overlap) {
    cube.clear();
    for (int i = 0; i < 10; ++i) {
      cube.splat(diskPatch(direction, kRound, .1f * axis_cubed, 0, overlap), {1, 2}, kWhite);
    }
    return double(cube.coverage(3));
  };
  EXPECT_GT(cover(0), .99);
  EXPECT_NEAR(cover(1), 1 - std::exp(-1.), .06);  // as anything spread at random
}

// What is left open of a floor of rectangles with these sides, on the side faces and across the
// edges of the cube, too; as a part of the whole.
double gapsOfFloor(float side_x, float side_y, const SymmetricMatrix& shape) {
  const RasterGeometry geometry(12);
  RasterCube cube(geometry, false);
  for (float x = -20 + side_x / 2; x < 20; x += side_x) {
    for (float y = -20 + side_y / 2; y < 20; y += side_y) {
      const glm::vec3 to_middle(x, y, -1);
      const float distance_sq = glm::dot(to_middle, to_middle);
      const glm::vec3 direction = to_middle / std::sqrt(distance_sq);
      const float spread = side_x * side_y / distance_sq;
      cube.splat({direction, {0, 0, 1}, shape, spread * -direction.z, spread, 0}, kDepth, kWhite);
    }
  }
  double error = 0, weight = 0;
  for (std::size_t i = 0; i < geometry.pixels().size(); ++i) {
    const RasterGeometry::Pixel& pixel = geometry.pixels()[i];
    if (pixel.direction.z > -.15f) continue;  // the end of the floor
    error += double(1 - cube.coverage(i)) * double(pixel.solid_angle);
    weight += double(pixel.solid_angle);
  }
  return error / weight;
}

TEST(RasterCube, NeighboursOfASlantedPlaneTile) {
  // Squares, as octree cells cut it
  EXPECT_LT(gapsOfFloor(.2f, .2f, withoutDirection({0, 0, 1})), .0025);
}

TEST(RasterCube, OblongNeighboursTileWhenTheyAreDrawnByTheirShape) {
  const float sides_sq = .1f * .1f + .3f * .3f;
  const SymmetricMatrix shape = {{2 * .1f * .1f / sides_sq, 2 * .3f * .3f / sides_sq, 0, 0, 0, 0}};
  EXPECT_LT(gapsOfFloor(.1f, .3f, shape), .008);
  EXPECT_GT(gapsOfFloor(.1f, .3f, withoutDirection({0, 0, 1})), .1);
}

TEST(RasterCube, SoftDiskCoversItsShare) {
  const RasterGeometry geometry(64);
  RasterCube cube(geometry, false);
  cube.traceDisk({0, 0, 20}, {0, 0, -1}, 2, 1, {}, kDepth, kWhite);
  EXPECT_NEAR(coveredSolidAngle(cube) / double(kPi / 100), .5, .03);
}

// Of such pixels the middle weighs nothing, or what rounding leaves of it.
TEST(RasterCube, HorizonsThroughTheMiddlesOfPixelsLeaveNumbers) {
  const RasterGeometry geometry(12);
  RasterCube cube(geometry, true);
  const auto pixels = geometry.pixels();
  for (std::size_t i = 0; i + 131 < pixels.size(); i += 7) {
    const glm::vec3 up = glm::normalize(glm::cross(pixels[i].direction, pixels[i + 131].direction));
    cube.clear(up, true);
    for (const float solid_angle : {.004f, .4f}) {
      for (const std::size_t at : {i, i + 131}) {
        cube.splat(diskPatch(pixels[at].direction, kRound, solid_angle, solid_angle), kDepth,
                   kWhite);
      }
    }
    cube.close();
    for (std::size_t at = 0; at < pixels.size(); ++at) {
      ASSERT_GE(cube.coverage(at), 0) << i << ' ' << at;
      ASSERT_LE(cube.coverage(at), 1) << i << ' ' << at;
      ASSERT_LE(cube.radiosity(at).x, kWhite.x * 1.001f) << i << ' ' << at;
    }
  }
}

TEST(RasterCube, ClearForgetsEverything) {
  const RasterGeometry geometry(4);
  RasterCube cube(geometry, true);
  cube.traceDisk({0, 0, 1}, {0, 0, -1}, 10, RasterCube::kHardDisk, {}, {5, 6}, kWhite);
  EXPECT_GT(coveredSolidAngle(cube), 1);
  cube.clear();
  EXPECT_EQ(coveredSolidAngle(cube), 0);
  cube.traceDisk({0, 0, 1}, {0, 0, -1}, 10, RasterCube::kHardDisk, {}, {1, 2}, kWhite);
  EXPECT_GT(coveredSolidAngle(cube), 1);
}

}  // namespace
}  // namespace surfeit
