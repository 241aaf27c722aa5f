// Things are closed before others behind them are drawn, and hide what lies behind their samples.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <random>

#include "gather/one_raster.h"

namespace surfeit {
namespace {

// A sheet of disks that face the cube at x = `distance`, on the face +x of 16 pixels: squares of
// `side` pixels, scattered by a part of that, within a square of `half` pixels, `aside` from the
// middle.
struct SheetOfDisks {
  float distance = 1, side = .8f, scatter = .3f, half = 8, aside = 0;
  bool is_solid = true;
  bool has_hull = true;
  float opacity = 1;
  unsigned seed = 4;

  void drawTo(OneRaster& raster, const glm::vec3& radiosity) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const float step = side * distance / 8;
    const int count = int(2 * half / side);
    for (int i = 0; i < count * count; ++i) {
      const float u = (float(i % count) + .5f + scatter * uniform(random)) * step +
                      (aside - half) * distance / 8;
      const float v =
          (float(i / count) + .5f + scatter * uniform(random)) * step - half * distance / 8;
      const glm::vec3 to(distance, u, v), direction = glm::normalize(to);
      Patch patch = patchAt(direction, {-1, 0, 0}, step * step * direction.x / glm::dot(to, to), 0,
                            .99f * distance, 1.01f * distance);
      patch.is_solid = is_solid;
      patch.has_gaps = !has_hull;
      patch.opacity = opacity, patch.clear = 1 - opacity, patch.layers = 1;
      patch.radiosity = radiosity;
      raster.add(patch);
    }
  }
};

class Closing : public ::testing::Test {
 protected:
  // Mean of the light, and of what is covered, of pixels in the middle of the face.
  glm::vec2 seen(int half) {
    glm::vec2 sum(0);
    for (int row = 8 - half; row < 8 + half; ++row) {
      for (int column = 8 - half; column < 8 + half; ++column) {
        const auto pixel = std::size_t(row * 16 + column);
        sum += glm::vec2(raster_.radiosity(pixel).x, raster_.coverage(pixel));
      }
    }
    return sum / float(4 * half * half);
  }
  const glm::vec3 dark_{0};
  OneRaster raster_{16};
};

// Between leaves nothing is closed: a sheet of them shows what gaps there are.
TEST_F(Closing, NothingShinesThroughTheGapsOfASheet) {
  for (const float side : {.1f, .3f, .8f, 1.7f}) {
    raster_.clear();
    SheetOfDisks{.side = side, .has_hull = false}.drawTo(raster_, dark_);
    ASSERT_LT(seen(4).y, .999f) << side;
    raster_.clear();
    SheetOfDisks{.side = side}.drawTo(raster_, dark_);
    SheetOfDisks{.distance = 3}.drawTo(raster_, kWhite);
    EXPECT_LT(seen(4).x, .003f) << side;
    EXPECT_NEAR(seen(4).y, 1, .003f) << side;
  }
}

// A translucent sheet has no gaps, and no places that hide more than it does.
TEST_F(Closing, TranslucentSheetsHideTheirOpacity) {
  for (const float side : {.1f, .3f, .8f, 1.7f}) {
    for (const float opacity : {.1f, .5f, .9f}) {
      raster_.clear();
      SheetOfDisks{.side = side, .opacity = opacity}.drawTo(raster_, kWhite);
      EXPECT_NEAR(seen(4).x, opacity, .01f) << side;
      EXPECT_NEAR(seen(4).y, opacity, .01f) << side;
    }
  }
}

// Also where two are too close to each other to be two things. (Their areas scatter, and in some
// pixels they are taken for fewer layers.)
TEST_F(Closing, SeveralTranslucentSheetsMultiply) {
  for (const float distance : {1.001f, 3.f}) {
    for (const float side : {.1f, .3f, .8f}) {
      for (const float opacity : {.1f, .5f, .9f}) {
        raster_.clear();
        SheetOfDisks{.side = side, .opacity = opacity}.drawTo(raster_, kWhite);
        SheetOfDisks{.distance = distance, .side = side, .opacity = opacity, .seed = 5}.drawTo(
            raster_, kWhite);
        EXPECT_NEAR(seen(4).y, 1 - (1 - opacity) * (1 - opacity), distance < 2 ? .05f : .01f)
            << distance << ' ' << side << ' ' << opacity;
      }
    }
  }
}

// An opaque one behind a translucent one, or before it, has no gaps either.
TEST_F(Closing, OpaqueSheetsCloseBeforeAndBehindTranslucentOnes) {
  for (const float distance : {1.001f, 3.f}) {
    for (const bool is_first : {true, false}) {
      raster_.clear();
      SheetOfDisks{.opacity = is_first ? .5f : 1.f}.drawTo(raster_, dark_);
      SheetOfDisks{.distance = distance, .opacity = is_first ? 1.f : .5f}.drawTo(raster_, dark_);
      SheetOfDisks{.distance = 5}.drawTo(raster_, kWhite);
      EXPECT_LT(seen(4).x, .003f) << distance << ' ' << is_first;
      EXPECT_NEAR(seen(4).y, 1, .003f) << distance << ' ' << is_first;
    }
  }
}

TEST_F(Closing, WhatIsClosedShinesAsItsThingDoes) {
  SheetOfDisks{}.drawTo(raster_, kWhite);
  SheetOfDisks{.distance = 3}.drawTo(raster_, dark_);
  EXPECT_NEAR(seen(4).x, 1, .003f);
}

// The sheet covers a square of 6 by 6 pixels, and a part of those around.
TEST_F(Closing, OutlinesStayWhereTheyAre) {
  SheetOfDisks{.side = .5f, .scatter = 0, .half = 3.25f}.drawTo(raster_, dark_);
  EXPECT_NEAR(seen(8).y * 256, 6.5f * 6.5f, .8f);
}

// Two sheets, one three times as far away, end beside each other in one pixel. Between sheets that
// may touch, so narrow a gap is none.
TEST_F(Closing, TheGapBetweenThingsBehindEachOtherStaysOpen) {
  const auto coveredOfRow = [&](float gap, float at, float distance) {
    raster_.clear();
    const SheetOfDisks sheet{.side = .5f, .scatter = 0, .half = 3};
    SheetOfDisks left = sheet, right = sheet;
    left.aside = at - gap / 2 - 3;
    right.aside = at + gap / 2 + 3;
    right.distance = distance;
    left.drawTo(raster_, dark_);
    right.drawTo(raster_, dark_);
    float sum = 0;
    for (std::size_t column = 6; column < 11; ++column) {
      for (const std::size_t row : {7u, 8u}) sum += raster_.coverage(16 * row + column) / 2;
    }
    return sum;
  };
  for (const float gap : {.3f, .5f}) {
    for (const float at : {.35f, .5f, .65f}) {
      EXPECT_NEAR(coveredOfRow(gap, at, 3), 5 - gap, .05f) << gap << ' ' << at;
      EXPECT_GT(coveredOfRow(gap, at, 1), 5 - .2f * gap) << gap << ' ' << at;
    }
  }
}

// A black sheet ends within the pixels of a column. A white one behind it begins or ends there, or
// goes on. At random the sheet would hide half of each in these pixels.
TEST_F(Closing, AnOutlineHidesWhatLiesBehindItAlone) {
  const auto lightOfColumn = [&](float left, float right) {
    raster_.clear();
    const SheetOfDisks sheet{.side = .5f, .scatter = 0, .half = 4};
    SheetOfDisks before = sheet, behind = sheet;
    before.aside = -3.5f;  // ends in the middle of column 8
    behind.distance = 3;
    behind.half = .5f * (right - left);
    behind.aside = .5f * (left + right) - 8;
    before.drawTo(raster_, dark_);
    behind.drawTo(raster_, kWhite);
    return raster_.radiosity(16 * 8 + 8).x;
  };
  EXPECT_NEAR(lightOfColumn(4, 8.5f), 0, .02f) << "behind the sheet";
  EXPECT_NEAR(lightOfColumn(8.5f, 12.5f), .5f, .02f) << "beside it";
  EXPECT_NEAR(lightOfColumn(4, 12), .5f, .02f) << "on both sides";
  EXPECT_NEAR(lightOfColumn(8, 12), .5f, .02f) << "in all of the pixel, and beyond";
}

TEST_F(Closing, GapsBetweenSpheresStayOpen) {
  SheetOfDisks{.scatter = 1.5f, .has_hull = false}.drawTo(raster_, kWhite);
  const float open = 1 - seen(8).y;
  ASSERT_GT(open, .1f);
  raster_.clear();
  SheetOfDisks{.scatter = 1.5f, .is_solid = false}.drawTo(raster_, kWhite);
  EXPECT_NEAR(1 - seen(8).y, open, .02f);
}

// Of less than a pixel, before a wall: it sends what its area says, wherever it is.
TEST_F(Closing, SmallThingsKeepTheirPower) {
  const SheetOfDisks wall{.distance = 3};
  double sum = 0;
  constexpr int kPlaces = 400;
  for (int i = 0; i < kPlaces; ++i) {
    raster_.clear();
    const glm::vec3 direction =
        glm::normalize(glm::vec3(1, .013f * float(i % 20), .017f * float(i / 20)));
    const float solid_angle = .1f * 4 / 256;
    Patch lamp = patchAt(direction, kRound, solid_angle, 0, .999f, 1.001f);
    lamp.is_solid = false;
    raster_.add(lamp);
    wall.drawTo(raster_, dark_);
    double power = 0;
    for (std::size_t pixel = 0; pixel < 256; ++pixel) {
      power += double(raster_.radiosity(pixel).x * raster_.solidAngle(pixel));
    }
    sum += power / double(solid_angle) / kPlaces;
  }
  EXPECT_NEAR(sum, 1, .01);
}

}  // namespace
}  // namespace surfeit
