#include "view/cube_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <limits>
#include <set>
#include <string>

#include "io/exr_test_picture.h"
#include "io/test_directory.h"
#include "view/cube_layout.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// A cube of n by n pixels a face that covers nothing.
CubeImage emptyCube(int n, const glm::vec3& normal) {
  CubeImage cube;
  cube.receiver.normal = normal;
  cube.resolution = n;
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    CubeFace& made = cube.faces.emplace_back();
    made.forward[axis] = face % 2 == 0 ? 1.f : -1.f;
    made.u[(axis + 1) % 3] = 1;
    made.v[(axis + 2) % 3] = 1;
    for (int i = 0; i < n * n; ++i) {
      const float a = float(2 * (i % n) + 1) / float(n) - 1;
      const float b = float(2 * (i / n) + 1) / float(n) - 1;
      CubePixel& pixel = cube.pixels.emplace_back();
      pixel.direction = glm::normalize(made.forward + a * made.u + b * made.v);
      pixel.solid_angle = 4 * 3.14159265f / float(6 * n * n);
      pixel.weight = std::max(0.f, glm::dot(pixel.direction, normal));
    }
  }
  return cube;
}

glm::vec3 directionAt(const CubeImage& cube, const CubeLayout& layout, int x, int y) {
  return cube.pixels[std::size_t(layout.pixel(x, y))].direction;
}

TEST(CubeLayout, EveryPixelIsThereOnce) {
  for (const UpAxis up : {UpAxis::kX, UpAxis::kY, UpAxis::kZ}) {
    for (const glm::vec3& normal : {glm::vec3(0, 1, 0), glm::vec3(0, -1, 0), glm::vec3(1, 0, 0),
                                    glm::vec3(0, 0, -1), glm::vec3(0)}) {
      const CubeImage cube = emptyCube(4, normal);
      const CubeLayout layout(cube, up);
      ASSERT_EQ(layout.width(), 16);
      ASSERT_EQ(layout.height(), 12);
      std::multiset<std::int32_t> found;
      for (int y = 0; y < 12; ++y) {
        for (int x = 0; x < 16; ++x) {
          if (layout.pixel(x, y) != CubeLayout::kOutside) found.insert(layout.pixel(x, y));
        }
      }
      EXPECT_EQ(found.size(), cube.pixels.size());
      EXPECT_EQ(std::set<std::int32_t>(found.begin(), found.end()).size(), cube.pixels.size());
    }
  }
}

// Across the edges that faces share in the picture, directions go on.
TEST(CubeLayout, NeighboursInThePictureAreNeighboursInTheWorld) {
  for (const glm::vec3& normal : {glm::vec3(0, 1, 0), glm::vec3(0, -1, 0), glm::vec3(.2f, .1f, .9f),
                                  glm::vec3(-1, 0, 0), glm::vec3(0)}) {
    const CubeImage cube = emptyCube(8, normal);
    const CubeLayout layout(cube, UpAxis::kZ);
    for (int y = 0; y + 1 < layout.height(); ++y) {
      for (int x = 0; x + 1 < layout.width(); ++x) {
        if (layout.pixel(x, y) == CubeLayout::kOutside) continue;
        for (const auto& [next_x, next_y] : {std::pair(x + 1, y), std::pair(x, y + 1)}) {
          if (layout.pixel(next_x, next_y) == CubeLayout::kOutside) continue;
          EXPECT_GT(
              glm::dot(directionAt(cube, layout, x, y), directionAt(cube, layout, next_x, next_y)),
              .95f);
        }
      }
    }
  }
}

TEST(CubeLayout, IsSeenFromInside) {
  // Looking up with y up: what is ahead (-z) is below in the picture, +x to the right
  const CubeImage floor = emptyCube(8, {0, 1, 0});
  const CubeLayout up(floor, UpAxis::kY);
  EXPECT_GT(directionAt(floor, up, 12, 12).y, .9f);
  EXPECT_GT(directionAt(floor, up, 20, 12).x, .9f);
  EXPECT_LT(directionAt(floor, up, 4, 12).x, -.9f);
  EXPECT_GT(directionAt(floor, up, 12, 4).z, .9f);
  EXPECT_LT(directionAt(floor, up, 12, 20).z, -.9f);
  EXPECT_LT(directionAt(floor, up, 28, 12).y, -.9f);
  // From a wall along +x with z up: up is up, and +y is to the left
  const CubeImage wall = emptyCube(8, {1, 0, 0});
  const CubeLayout level(wall, UpAxis::kZ);
  EXPECT_GT(directionAt(wall, level, 12, 12).x, .9f);
  EXPECT_GT(directionAt(wall, level, 12, 4).z, .9f);
  EXPECT_GT(directionAt(wall, level, 4, 12).y, .9f);
}

TEST(CubePicture, PanelsShowTheirValues) {
  CubeImage cube = emptyCube(2, {0, 1, 0});
  for (CubePixel& pixel : cube.pixels) {
    if (!(pixel.weight > 0)) continue;
    pixel.coverage = .5f;
    pixel.light = {1, 0, 0};
    pixel.depth = 2;
    pixel.layers = 2;
    pixel.kind = CubeKind::kTraced;
  }
  CubePictureOptions options;
  options.zoom = 3;
  const Picture picture = drawCube({&cube, nullptr}, options);
  // Three crosses of 24 by 18 pixels, two below
  ASSERT_EQ(picture.width, 12 + 3 * (24 + 12));
  ASSERT_EQ(picture.height, 12 + 2 * (18 + 12));
  const auto middle = [&](int column, int row) {
    return picture.at(12 + 36 * column + 9, 12 + 30 * row + 9).color;
  };
  EXPECT_NEAR(middle(0, 0).r, 1, 1e-5f);
  EXPECT_EQ(middle(0, 0).g, 0);
  EXPECT_EQ(middle(1, 0), glm::vec3(.5f));
  EXPECT_EQ(middle(2, 0), glm::vec3(1));
  EXPECT_EQ(middle(0, 1), glm::vec3(.5f));
  EXPECT_GT(middle(1, 1).r, middle(1, 1).g);
  // Below the horizon: dimmed, and no longer black
  EXPECT_GT(picture.at(12 + 36 + 20, 12 + 9).color.r, 0);
  EXPECT_LT(picture.at(12 + 36 + 20, 12 + 9).color.r, .3f);
}

TEST(CubePicture, TracedPanelsStandBesideTheGathered) {
  const CubeImage gathered = emptyCube(2, {0, 1, 0});
  CubeImage traced = gathered;
  for (CubePixel& pixel : traced.pixels) pixel.coverage = 1;
  CubePictureOptions options;
  options.zoom = 1;
  options.panels = {CubePanel::kCoverage};
  const CubeViews views = {&gathered, &traced};
  const Picture picture = drawCube(views, options);
  ASSERT_EQ(picture.width, 12 + 2 * (8 + 12));
  EXPECT_EQ(picture.at(12 + 3, 12 + 3).color, glm::vec3(0));
  EXPECT_EQ(picture.at(12 + 20 + 3, 12 + 3).color, glm::vec3(1));
  EXPECT_THAT(cubeLegend(views, options), HasSubstr("coverage | coverage of rays"));
}

TEST(CubePicture, LegendNamesTheColors) {
  CubeImage cube = emptyCube(2, {0, 1, 0});
  const std::string nothing = cubeLegend({&cube, nullptr}, {});
  EXPECT_THAT(nothing, HasSubstr("rough node"));
  for (CubePixel& pixel : cube.pixels) pixel.depth = 4 - pixel.weight;
  EXPECT_THAT(cubeLegend({&cube, nullptr}, {}), HasSubstr("white 3.184, dark gray 3.592"));
}

class CubeExr : public DirectoryTest {};

TEST_F(CubeExr, PicturesOfNoExposureAreRefused) {
  const CubeImage cube = emptyCube(2, {0, 1, 0});
  CubePictureOptions options;
  for (const float exposure :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    options.exposure = exposure;
    const Status status = writeCubePicture(path("cube.png"), {&cube, nullptr}, options, 0);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr("exposure must be finite"));
  }
}

TEST_F(CubeExr, HoldsTheValues) {
  CubeImage cube = emptyCube(2, {0, 1, 0});
  double expected = 0;
  for (std::size_t i = 0; i < cube.pixels.size(); ++i) {
    CubePixel& pixel = cube.pixels[i];
    pixel.coverage = float(i) / float(cube.pixels.size());
    pixel.light = {2, 1, .5f};
    pixel.kind = CubeKind::kFacet;
    expected += double(pixel.weight * pixel.solid_angle * pixel.coverage);
  }
  CubeImage traced = cube;
  for (CubePixel& pixel : traced.pixels) pixel.depth = 7;
  const Status written = writeCubeExr(path("cube.exr"), {&cube, &traced}, UpAxis::kY);
  ASSERT_TRUE(written.ok()) << written.message();
  const auto channel = [&](const std::string& name) { return readExrTest(path("cube.exr"), name); };
  const auto coverage = channel("coverage"), weight = channel("weight"), kind = channel("kind");
  ASSERT_EQ(coverage.size(), std::size_t(8 * 6));
  double sum = 0;
  for (std::size_t i = 0; i < coverage.size(); ++i) sum += double(weight[i] * coverage[i]);
  EXPECT_NEAR(sum, expected, 1e-5);
  EXPECT_EQ(kind[0], 0);  // a corner, beside the faces
  EXPECT_EQ(kind[8 * 2 + 2], 2);
  EXPECT_EQ(channel("R")[8 * 2 + 2], 2);
  EXPECT_EQ(channel("depth")[8 * 2 + 2], std::numeric_limits<float>::infinity());
  EXPECT_EQ(channel("reference.depth")[8 * 2 + 2], 7);
}

}  // namespace
}  // namespace surfeit
