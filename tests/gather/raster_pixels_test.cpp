// What the pixels of a receiver's raster hold of patches and ray-traced surfels.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "gather/one_raster.h"
#include "gather/rules/coverage_rules.h"

namespace surfeit {
namespace {

// Of the near field.
Patch tracedSphere(const glm::vec3& centre, float radius) {
  Patch patch;
  patch.position = centre;
  patch.radius = radius;
  patch.shape = withoutDirection(kRound);
  patch.area = patch.most_area = patch.round_area = kPi * radius * radius;
  patch.near_distance = 1e9f;
  patch.seen = Patch::Seen::kAllAround;
  return patch;
}
constexpr float kHardDisk = 1e6f;  // the peak of a disk that covers all its pixels fully
Patch tracedDisk(const glm::vec3& centre, const glm::vec3& normal, float radius, float peak) {
  Patch patch;
  patch.position = centre;
  patch.radius = radius;
  patch.normal = normal;
  patch.shape = withoutDirection(normal);
  patch.area = patch.most_area = patch.disk_area = kPi * radius * radius;
  patch.near_distance = 1e9f;
  patch.soft_peak = peak;
  patch.seen = Patch::Seen::kBoth;
  return patch;
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

TEST(RasterPixels, PatchesKeepTheirSolidAngleEverywhere) {
  for (const int resolution : {12, 32, 64}) {
    OneRaster raster(resolution);
    for (const glm::vec3& direction : testDirections()) {
      for (const float solid_angle : {1e-4f, .01f, .05f}) {
        raster.clear();
        Patch patch = patchAt(direction, kRound, solid_angle, solid_angle);
        patch.has_gaps = true;  // nothing is closed
        raster.add(patch);
        // What spills over an edge is drawn as a rectangle instead of a trapezoid, and the part
        // of a pixel that is covered is measured on the face
        const double tolerance = resolution == 12 ? .18 : .10;
        EXPECT_NEAR(raster.coveredSolidAngle() / double(solid_angle), 1, tolerance)
            << resolution << ": " << direction.x << " " << direction.y << " " << direction.z;
      }
    }
  }
}

TEST(RasterPixels, PatchesOfAllDirectionsConserveSolidAngleOnAverage) {
  OneRaster raster(12);
  double ratio = 0;
  for (const glm::vec3& direction : testDirections()) {
    raster.clear();
    raster.add(patchAt(direction, kRound, 2e-4f));
    ratio += raster.coveredSolidAngle() / 2e-4;
  }
  EXPECT_NEAR(ratio / double(testDirections().size()), 1, .01);
}

TEST(RasterPixels, SlantedDisksFollowTheirShape) {
  OneRaster raster(64);
  // Seen from straight below, a disk leaning in z is narrow in z and wide in y on the +x face
  raster.add(patchAt({1, 0, 0}, glm::normalize(glm::vec3(-.3f, 0, 1)), .01f));
  int columns = 0, rows = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    columns += raster.coverage(32 * 64 + i) > 0;
    rows += raster.coverage(i * 64 + 32) > 0;
  }
  EXPECT_GT(columns, 2 * rows);
}

TEST(RasterPixels, TracedDisksHaveTheirAnalyticSolidAngle) {
  OneRaster raster(64);
  for (const glm::vec3& direction : testDirections()) {
    for (const float distance : {.2f, 1.f, 3.f}) {
      raster.clear();
      raster.add(tracedDisk(distance * direction, direction, 1, kHardDisk));
      const double expected =
          2 * double(kPi) *
          (1 - double(distance) / std::sqrt(1 + double(distance) * double(distance)));
      EXPECT_NEAR(raster.coveredSolidAngle() / expected, 1, .035);
    }
  }
}

TEST(RasterPixels, ATracedDiskAcrossTheOriginCoversHalfTheSphere) {
  OneRaster raster(16);
  const glm::vec3 normal = glm::normalize(glm::vec3(1, 2, 3));
  raster.add(tracedDisk(1e-4f * normal, normal, 100, kHardDisk));
  EXPECT_NEAR(raster.coveredSolidAngle(), 2 * double(kPi), .06);
}

// Of a receiver that faces it: without a normal it would be a sphere itself.
TEST(RasterPixels, TracedSpheresHaveTheirAnalyticSolidAngle) {
  for (const glm::vec3& direction : testDirections()) {
    OneRaster raster(64, direction);
    for (const float distance : {1.001f, 1.5f, 4.f}) {
      raster.clear();
      raster.add(tracedSphere(distance * direction, 1));
      const double sine = 1 / double(distance);
      const double expected = 2 * double(kPi) * (1 - std::sqrt(1 - sine * sine));
      EXPECT_NEAR(raster.coveredSolidAngle() / expected, 1, .035);
    }
  }
}

TEST(RasterPixels, CoverageAddsWithinAThingAndNeverExceedsOne) {
  OneRaster raster(12);
  for (int i = 0; i < 100; ++i) {
    for (const glm::vec3& direction : testDirections()) {
      raster.add(patchAt(direction, kRound, .06f, 0, 1 + float(i) / 10, 1 + float(i + 7) / 10));
    }
  }
  for (std::size_t i = 0; i < raster.size(); ++i) {
    ASSERT_EQ(raster.coverage(i), 1) << i;
    ASSERT_NEAR(raster.radiosity(i).x, 1, 1e-5);
  }
}

// Of two pixels along a face, one is a quarter of it: what covers so much of the one in direction
// (1, .5, .5).
constexpr std::size_t kQuarter = 3;
Patch quarterPatch(float amount, float begin, float end, const glm::vec3& radiosity = kWhite) {
  const glm::vec3 direction = glm::normalize(glm::vec3(1, .5f, .5f));
  Patch patch =
      patchAt(direction, kRound, amount * direction.x * direction.x * direction.x, 0, begin, end);
  patch.is_solid = false;
  patch.radiosity = radiosity;
  return patch;
}

TEST(RasterPixels, ThingsCoverEachOtherInsteadOfAdding) {
  OneRaster raster(2);
  Patch without_hull = quarterPatch(.5f, 1, 2, {1, 0, 0});
  without_hull.has_gaps = true;
  raster.add(without_hull);
  EXPECT_NEAR(raster.coverage(kQuarter), .5f, 1e-5);
  raster.add(quarterPatch(.5f, 2.01f, 3, {0, 1, 0}));  // half of the rest
  EXPECT_NEAR(raster.coverage(kQuarter), .75f, 1e-5);
  EXPECT_NEAR(raster.radiosity(kQuarter).x, .5f, 1e-5);
  EXPECT_NEAR(raster.radiosity(kQuarter).y, .25f, 1e-5);

  raster.clear();
  raster.add(quarterPatch(.5f, 1, 2, {1, 0, 0}));
  raster.add(quarterPatch(.5f, 1.99f, 3, {0, 1, 0}));  // of the same thing
  EXPECT_NEAR(raster.coverage(kQuarter), 1, 1e-5);
  EXPECT_NEAR(raster.radiosity(kQuarter).y, .5f, 1e-5);
}

// Halves of one thing, and what is alone before, between or behind them: it hides half of both.
TEST(RasterPixels, WhatIsAloneBelongsToNoThing) {
  for (const float place : {.5f, 1.6f, 4.f}) {
    OneRaster raster(2);
    raster.add(quarterPatch(.5f, 1, 2, {1, 0, 0}));
    raster.add(quarterPatch(.4f, 1.5f, 2.5f, {1, 0, 0}));
    Patch alone = quarterPatch(.5f, .9f * place, 1.1f * place, {0, 1, 0});
    alone.is_alone = true;
    raster.add(alone);
    EXPECT_NEAR(raster.coverage(kQuarter), .95f, 1e-5) << place;
  }
}

TEST(RasterPixels, PatchesThatAreAloneHideEachOtherAtRandom) {
  OneRaster raster(2);
  const auto covered = [&](bool is_alone) {
    raster.clear();
    for (int i = 0; i < 10; ++i) {
      Patch patch = quarterPatch(.1f, 1, 2);
      patch.is_alone = is_alone;
      raster.add(patch);
    }
    return double(raster.coverage(kQuarter));
  };
  EXPECT_GT(covered(false), .99);
  EXPECT_NEAR(covered(true), 1 - std::pow(.9, 10), 1e-4);
}

// What is left open of a floor of rectangles with these sides, on the side faces and across the
// edges of the cube, too; as a part of the whole. Nothing is closed.
double gapsOfFloor(float side_x, float side_y, const SymmetricMatrix& shape) {
  OneRaster raster(12);
  for (float x = -20 + side_x / 2; x < 20; x += side_x) {
    for (float y = -20 + side_y / 2; y < 20; y += side_y) {
      const glm::vec3 to_middle(x, y, -1);
      const float distance_sq = glm::dot(to_middle, to_middle);
      const glm::vec3 direction = to_middle / std::sqrt(distance_sq);
      const float spread = side_x * side_y / distance_sq;
      Patch patch = patchAt(direction, {0, 0, 1}, spread * -direction.z, spread);
      patch.shape = shape;
      patch.is_solid = false;
      patch.has_gaps = true;
      raster.add(patch);
    }
  }
  double error = 0, weight = 0;
  for (std::size_t i = 0; i < raster.size(); ++i) {
    if (raster.geometry().pixels()[i].direction.z > -.15f) continue;  // the end of the floor
    error += double(1 - raster.coverage(i)) * double(raster.solidAngle(i));
    weight += double(raster.solidAngle(i));
  }
  return error / weight;
}

TEST(RasterPixels, NeighboursOfASlantedPlaneTile) {
  // Squares, as octree cells cut it
  EXPECT_LT(gapsOfFloor(.2f, .2f, withoutDirection({0, 0, 1})), .0025);
}

TEST(RasterPixels, OblongNeighboursTileWhenTheyAreDrawnByTheirShape) {
  const float sides_sq = .1f * .1f + .3f * .3f;
  const SymmetricMatrix shape = {{2 * .1f * .1f / sides_sq, 2 * .3f * .3f / sides_sq, 0, 0, 0, 0}};
  EXPECT_LT(gapsOfFloor(.1f, .3f, shape), .008);
  EXPECT_GT(gapsOfFloor(.1f, .3f, withoutDirection({0, 0, 1})), .1);
}

TEST(RasterPixels, SoftDisksCoverTheirShare) {
  OneRaster raster(64);
  raster.add(tracedDisk({0, 0, 20}, {0, 0, -1}, 2, 1));
  EXPECT_NEAR(raster.coveredSolidAngle() / double(kPi / 100), .5, .03);
}

// Of such pixels the middle weighs nothing, or what rounding leaves of it.
TEST(RasterPixels, HorizonsThroughTheMiddlesOfPixelsLeaveNumbers) {
  GatherQuality quality;
  quality.raster_resolution = 12;
  const GatherRules rules(GatherMode::kBleeding, quality);
  PacketRaster raster(rules);
  const auto pixels = raster.geometry().pixels();
  std::vector<PixelContent> contents(pixels.size());
  for (std::size_t i = 0; i + 131 < pixels.size(); i += 7) {
    const LocalReceiver receiver = {
        glm::vec3(0), glm::normalize(glm::cross(pixels[i].direction, pixels[i + 131].direction))};
    raster.begin({&receiver, 1}, viewPacket({&receiver, 1}, rules));
    for (const float solid_angle : {.004f, .4f}) {
      for (const std::size_t at : {i, i + 131}) {
        raster.addPatch(patchAt(pixels[at].direction, kRound, solid_angle, solid_angle));
      }
    }
    raster.sort();
    raster.draw();
    raster.readPixels(contents);
    for (std::size_t at = 0; at < pixels.size(); ++at) {
      ASSERT_GE(contents[at].coverage, 0) << i << ' ' << at;
      ASSERT_LE(contents[at].coverage, 1) << i << ' ' << at;
      ASSERT_LE(contents[at].radiosity.x, kWhite.x * 1.001f) << i << ' ' << at;
    }
  }
}

TEST(RasterPixels, ClearForgetsEverything) {
  OneRaster raster(4);
  raster.add(tracedDisk({0, 0, 1}, {0, 0, -1}, 10, kHardDisk));
  EXPECT_GT(raster.coveredSolidAngle(), 1);
  raster.clear();
  EXPECT_EQ(raster.coveredSolidAngle(), 0);
}

}  // namespace
}  // namespace surfeit
