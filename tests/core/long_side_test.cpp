#include "core/long_side.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace surfeit {
namespace {

constexpr float kDegree = 0.0175f;

TEST(LongSide, DirectionsAreWithinADegree) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 10'000; ++i) {
    const glm::vec3 v(normal(random), normal(random), normal(random));
    const glm::vec3 found = directionOf(directionCode(1000.f * v));
    ASSERT_NEAR(glm::length(found), 1, 1e-6f);
    ASSERT_GT(glm::dot(found, glm::normalize(v)), std::cos(kDegree));
  }
  for (const glm::vec3& axis : {glm::vec3(1, 0, 0), glm::vec3(0, -1, 0), glm::vec3(0, 0, -1)}) {
    EXPECT_EQ(directionOf(directionCode(axis)), axis);
  }
}

TEST(LongSide, WhatIsNoDirectionHasNoCode) {
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(directionCode(glm::vec3(0)), kNoLongSide);
  EXPECT_EQ(directionCode({infinity, 0, 0}), kNoLongSide);
  EXPECT_EQ(directionCode({0, std::numeric_limits<float>::quiet_NaN(), 1}), kNoLongSide);
  EXPECT_EQ(directionOf(kNoLongSide), glm::vec3(0));
}

// What is written to a cloud and read again stays as it is.
TEST(LongSide, EveryCodeThatAPageMayHoldComesBack) {
  Surfel surfel;
  surfel.area = 0.37f;
  int count = 0;
  for (std::uint32_t code = 0; code < 0x10000; ++code) {
    const auto direction = static_cast<std::uint16_t>(code);
    const auto elongation = static_cast<std::uint8_t>(code * 7 >> 3);
    if (!isDirection(direction) || !isLongSide(direction)) continue;
    surfel.long_side = direction;
    surfel.elongation = elongation;
    Surfel again;
    again.area = surfel.area;
    setLongSide(longSideOf(surfel), again);
    const glm::vec3 off = directionOf(again.long_side) - directionOf(direction);
    ASSERT_LT(glm::length(off), 1e-6f) << code;
    ASSERT_EQ(again.elongation, elongation) << code;
    ++count;
  }
  EXPECT_EQ(count, 255 * 255);
}

TEST(LongSide, ElongationIsLengthOverWidth) {
  Surfel surfel;
  surfel.area = 2 * 0.1f;
  setLongSide({0, 2, 0}, surfel);
  EXPECT_NEAR(elongationOf(surfel), 20, 0.25f);
  EXPECT_NEAR(longSideOf(surfel).y, 2, 0.025f);
  setLongSide({0, 0.1f, 0}, surfel);  // again, now shorter than wide: as a square
  EXPECT_EQ(elongationOf(surfel), 1);
}

TEST(LongSide, PagesHoldNoHalfDirections) {
  EXPECT_TRUE(isLongSide(kNoLongSide));
  EXPECT_FALSE(isLongSide(0x0001));
  EXPECT_TRUE(isLongSide(0x0101));
}

// Of disks the elongation is the number of surfels that share the piece.
TEST(LongSide, DisksMaySharePieces) {
  Surfel surfel;
  surfel.area = 0.5f;
  EXPECT_EQ(sharersOf(surfel), 1);
  setSharers(4, surfel);
  EXPECT_EQ(sharersOf(surfel), 4);
  EXPECT_EQ(pieceArea(surfel), 2);
  EXPECT_EQ(elongationOf(surfel), 1);
  EXPECT_EQ(longSideOf(surfel), glm::vec3(0));
  setSharers(3, surfel);
  EXPECT_NEAR(sharersOf(surfel), 3, 0.03f);
  setSharers(1e6f, surfel);
  EXPECT_NEAR(sharersOf(surfel), 251, 1);
  setSharers(1, surfel);
  EXPECT_EQ(sharersOf(surfel), 1);
}

// Of disks the direction's bytes are the cell that a tile of a surface hides.
TEST(LongSide, DisksMayBeTilesOfACell) {
  Surfel surfel;
  surfel.area = 0.5f;
  EXPECT_FALSE(isTile(surfel));
  EXPECT_EQ(tileShare(surfel), 1);
  for (const float cell : {0.05f, 0.4f, 0.5f, 1.3f, 6.f}) {
    setTile(cell, surfel);
    EXPECT_TRUE(isTile(surfel) && isLongSide(surfel.long_side));
    EXPECT_NEAR(tileShare(surfel) * surfel.area, cell, 0.011f * cell);
    EXPECT_FALSE(hasLongSide(surfel));
    EXPECT_EQ(directionOf(surfel.long_side), glm::vec3(0));
    EXPECT_EQ(longSideOf(surfel), glm::vec3(0));
    EXPECT_EQ(sharersOf(surfel), 1);
  }
  setTile(1e9f, surfel);
  EXPECT_NEAR(tileShare(surfel), 16, 0.5f);
  setTile(1e-9f, surfel);
  EXPECT_NEAR(tileShare(surfel), 1 / 16.f, 0.01f);
  setSharers(4, surfel);  // both
  EXPECT_EQ(sharersOf(surfel), 4);
  EXPECT_NEAR(tileShare(surfel), 1 / 16.f, 0.01f);
}

TEST(LongSide, RectanglesShareNothing) {
  Surfel surfel;
  surfel.area = 0.2f;
  setLongSide({0, 2, 0}, surfel);
  const Surfel before = surfel;
  setSharers(4, surfel);
  setTile(3, surfel);
  EXPECT_EQ(surfel.elongation, before.elongation);
  EXPECT_EQ(surfel.long_side, before.long_side);
  EXPECT_EQ(sharersOf(surfel), 1);
  EXPECT_FALSE(isTile(surfel));
}

}  // namespace
}  // namespace surfeit
