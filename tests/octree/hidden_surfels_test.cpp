#include "octree/build/hidden_surfels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "octree/node/hidden_layers.h"
#include "octree/node/node_sums.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// `side` x `side` surfels that face +z, a spacing of 1 apart, around (0, 0, height). Noise is along
// z, in spacings.
std::vector<Surfel> sheet(int side, float height, float noise = 0, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> off(-noise, noise);
  std::vector<Surfel> surfels;
  for (int i = 0; i < side * side; ++i) {
    Surfel& surfel = surfels.emplace_back();
    surfel.position = {float(i % side) - .5f * float(side - 1),
                       float(i / side) - .5f * float(side - 1),
                       height + (noise > 0 ? off(random) : 0)};
    surfel.normal = {0, 0, 1};
    surfel.area = 1;
    surfel.radius = .71f;
  }
  return surfels;
}

std::vector<Surfel> together(std::vector<Surfel> a, const std::vector<Surfel>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::ptrdiff_t hiddenCount(std::span<const Surfel> surfels, std::uint8_t side = kHiddenFront) {
  return std::count_if(surfels.begin(), surfels.end(),
                       [=](const Surfel& surfel) { return (hiddenSidesOf(surfel) & side) != 0; });
}

TEST(HiddenSurfels, SheetBehindAnotherIsHidden) {
  for (const float gap : {.001f, .1f, 1.f, 4.f}) {
    std::vector<Surfel> cell = together(sheet(16, 0), sheet(16, -gap));
    markHidden(cell);
    EXPECT_EQ(hiddenCount(std::span(cell).first(256)), 0) << gap;
    const std::ptrdiff_t hidden = hiddenCount(std::span(cell).last(256));
    // Those as near to the edge as the sheets are apart are seen by who looks aslant
    EXPECT_GE(hidden, gap < 2 ? 256 : 100) << gap;
  }
}

// A border of cells may lie between sheets, or cut both.
TEST(HiddenSurfels, WhatLiesAroundACellHidesToo) {
  std::vector<Surfel> behind = together(sheet(16, -.2f), sheet(16, 0));
  markHidden(behind, 256);
  EXPECT_EQ(hiddenCount(std::span(behind).first(256)), 256);
  EXPECT_EQ(hiddenCount(behind), 256);

  std::vector<Surfel> corner, around;
  for (const Surfel& surfel : together(sheet(16, -4), sheet(16, 0))) {
    const bool is_own = surfel.position.x > 2 && surfel.position.y > 2;
    (is_own ? corner : around).push_back(surfel);
  }
  std::vector<Surfel> cut = together(corner, around);
  markHidden(cut, corner.size());
  std::vector<Surfel> whole = cut;
  markHidden(whole);
  for (std::size_t i = 0; i < cut.size(); ++i) {
    EXPECT_EQ(hiddenSidesOf(cut[i]), i < corner.size() ? hiddenSidesOf(whole[i]) : 0) << i;
  }
  EXPECT_GT(hiddenCount(cut), 0);
}

TEST(HiddenSurfels, TwoSidedSheetsHideEachOther) {
  std::vector<Surfel> cell = together(sheet(8, 0), sheet(8, -.2f));
  for (std::size_t i = 0; i < cell.size(); ++i) {
    cell[i].flags = kSurfelTwoSided;
    if (i % 3 == 0) cell[i].normal = -cell[i].normal;
  }
  markHidden(cell);
  for (std::size_t i = 0; i < cell.size(); ++i) {
    const bool is_front = i < 64, is_turned = i % 3 == 0;
    EXPECT_EQ(hiddenSidesOf(cell[i]), is_front != is_turned ? kHiddenBack : kHiddenFront) << i;
  }
}

TEST(HiddenSurfels, MiddleOfThreeIsHiddenFromBothSides) {
  std::vector<Surfel> cell = together(together(sheet(8, 0), sheet(8, -.2f)), sheet(8, -.4f));
  for (Surfel& surfel : cell) surfel.flags = kSurfelTwoSided;
  markHidden(cell);
  EXPECT_EQ(hiddenSidesOf(cell[0]), kHiddenBack);
  EXPECT_EQ(hiddenSidesOf(cell[64]), kHiddenSides);
  EXPECT_EQ(hiddenSidesOf(cell[128]), kHiddenFront);
}

TEST(HiddenSurfels, WhatLiesBesideIsSeen) {
  std::vector<Surfel> stairs = sheet(8, 0);
  for (Surfel& surfel : stairs) surfel.position.z = surfel.position.x > 0 ? 1.f : 0.f;
  markHidden(stairs);
  EXPECT_EQ(hiddenCount(stairs), 0);

  std::vector<Surfel> floor = sheet(16, -.1f), rug;
  for (const Surfel& surfel : sheet(16, 0)) {
    if (surfel.position.x < 0) rug.push_back(surfel);
  }
  std::vector<Surfel> cell = together(floor, rug);
  markHidden(cell);
  for (const Surfel& surfel : cell) {
    EXPECT_EQ(hiddenSidesOf(surfel) != 0, surfel.position.z < 0 && surfel.position.x < 0);
  }
}

TEST(HiddenSurfels, FenceHidesWhatIsBehindItsBoards) {
  std::vector<Surfel> floor = sheet(16, -.1f), fence;
  const auto isBoard = [](const Surfel& surfel) {
    return int(std::floor(surfel.position.x + 8)) / 2 % 2 == 0;
  };
  for (const Surfel& surfel : sheet(16, 0)) {
    if (isBoard(surfel)) fence.push_back(surfel);
  }
  std::vector<Surfel> cell = together(floor, fence);
  markHidden(cell);
  for (const Surfel& surfel : cell) {
    EXPECT_EQ(hiddenSidesOf(surfel) != 0, surfel.position.z < 0 && isBoard(surfel));
  }
}

TEST(HiddenSurfels, FarSheetsAndTranslucentOnesHideNothing) {
  std::vector<Surfel> far = together(sheet(16, 0), sheet(16, -1.1f * kClosestLayers));
  markHidden(far);
  EXPECT_EQ(hiddenCount(far), 0);
  std::vector<Surfel> pane = together(sheet(16, 0), sheet(16, -.1f));
  for (std::size_t i = 0; i < 256; ++i) pane[i].transparency = transparencyOf(.5);
  markHidden(pane);
  EXPECT_EQ(hiddenCount(pane), 0);
}

TEST(HiddenSurfels, ScaleAndPlaceDoNotMatter) {
  std::vector<Surfel> rug = sheet(16, 0);
  std::erase_if(rug, [](const Surfel& surfel) { return surfel.position.y > 2; });
  const std::vector<Surfel> plain = together(rug, sheet(16, -.25f));
  std::vector<Surfel> expected = plain;
  markHidden(expected);
  ASSERT_EQ(hiddenCount(expected), std::ptrdiff_t(rug.size()));
  for (const float scale : {1e-15f, 1e-6f, 1e6f, 1e15f}) {
    for (const float place : {0.f, 1000.f}) {
      std::vector<Surfel> cell = plain;
      for (Surfel& surfel : cell) {
        surfel.position = scale * (surfel.position + glm::vec3(place));
        surfel.radius *= scale;
        surfel.area *= scale * scale;
      }
      markHidden(cell);
      for (std::size_t i = 0; i < cell.size(); ++i) {
        ASSERT_EQ(hiddenSidesOf(cell[i]), hiddenSidesOf(expected[i])) << scale << ' ' << place;
      }
    }
  }
}

// Rows of an even grid have heights of their own, which are no layers; and a bent sheet behind
// another one has no clear gap along one normal.
TEST(HiddenSurfels, BentSheetsAreSheets) {
  const auto bent = [](float depth) {
    std::vector<Surfel> surfels = sheet(16, 0);
    for (Surfel& surfel : surfels) {
      const float angle = surfel.position.x / 100, radius = 100 - depth;
      surfel.position = {radius * std::sin(angle), surfel.position.y, radius * std::cos(angle)};
      surfel.normal = {std::sin(angle), 0, std::cos(angle)};
    }
    return surfels;
  };
  std::vector<Surfel> one = bent(0);
  markHidden(one);
  EXPECT_EQ(hiddenCount(one), 0);
  std::vector<Surfel> two = together(bent(0), bent(.05f));
  markHidden(two);
  EXPECT_EQ(hiddenCount(std::span(two).first(256)), 0);
  EXPECT_EQ(hiddenCount(std::span(two).last(256)), 256);
}

TEST(HiddenSurfels, NoiseIsNoLayer) {
  std::ptrdiff_t hidden = 0, all = 0;
  for (const int side : {3, 4, 8, 16}) {
    for (unsigned seed = 0; seed < 200; ++seed) {
      std::vector<Surfel> cell = sheet(side, 0, .3f, seed);
      std::shuffle(cell.begin(), cell.end(), std::mt19937(seed));
      markHidden(cell);
      hidden += hiddenCount(cell);
      all += std::ptrdiff_t(cell.size());
    }
  }
  EXPECT_LE(double(hidden), 1e-3 * double(all));
}

// Heights of a few places look like sheets by chance, however many surfels lie there.
TEST(HiddenSurfels, PlacesCountAndNotRecords) {
  std::ptrdiff_t hidden = 0, all = 0;
  for (const int side : {2, 3}) {
    for (unsigned seed = 0; seed < 500; ++seed) {
      const std::vector<Surfel> once = sheet(side, 0, .3f, seed);
      std::vector<Surfel> cell;
      for (const Surfel& surfel : once) cell.insert(cell.end(), 4, surfel);
      markHidden(cell);
      hidden += hiddenCount(cell);
      all += std::ptrdiff_t(cell.size());
    }
  }
  EXPECT_LE(double(hidden), 1e-3 * double(all));
}

TEST(HiddenSurfels, SpheresAndFewSurfelsAreLeftAlone) {
  std::vector<Surfel> cell = together(sheet(8, 0), sheet(8, -.1f));
  for (Surfel& surfel : cell) surfel.flags = kSurfelSphere, surfel.normal = {0, 0, 0};
  markHidden(cell);
  EXPECT_EQ(hiddenCount(cell), 0);
  std::vector<Surfel> none;
  markHidden(none);
}

// What is hidden is a facet by itself, or a flat node that says so; and the file says that it has
// such.
class HiddenNodes : public SceneTest {};

TEST_F(HiddenNodes, AreFacetsOfTheirOwn) {
  std::vector<Surfel> cell = together(sheet(8, 0), sheet(8, -.2f));
  markHidden(cell);
  NodeSums sums;
  for (const Surfel& surfel : cell) sums.add(surfel);
  const Node node = sums.toNode(.97f, radiusOfBox(sums.centre(), sums.disk_bounds));
  EXPECT_FALSE(node.isFlat());
  ASSERT_EQ(node.facet_count, 2);
  EXPECT_EQ(node.facets[0].hidden | node.facets[1].hidden, kHiddenFront);
  EXPECT_EQ(node.facets[0].hidden & node.facets[1].hidden, 0);
  NodeSums behind;
  for (const Surfel& surfel : std::span(cell).last(64)) behind.add(surfel);
  const Node flat = behind.toNode(.97f, radiusOfBox(behind.centre(), behind.disk_bounds));
  EXPECT_TRUE(flat.isFlat());
  EXPECT_EQ(flat.hidden, kHiddenFront);
}

TEST_F(HiddenNodes, AreStoredAndVerified) {
  for (const bool is_two_sided : {false, true}) {
    std::vector<Surfel> cloud = together(sheet(40, 0), sheet(40, -.2f));
    for (Surfel& surfel : cloud) {
      if (is_two_sided) surfel.flags = kSurfelTwoSided;
      surfel.radiosity = glm::vec3(surfel.position.z < -.1f ? 0.f : 1.f);
    }
    const std::string path = index(cloud);
    EXPECT_THAT(findingsOf(path), testing::IsEmpty());
    const Result<ReadScene> scene = readScene(path);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_TRUE(scene->header.has_layers);
    EXPECT_EQ(hiddenCount(scene->surfels), 1600);
    int pieces = 0;
    for (const ReadScene::ReadNode& read : scene->nodes) {
      const std::size_t count = read.node.isFlat() ? 1 : read.node.facet_count;
      for (std::size_t k = 0; k < count; ++k) {
        const bool is_behind = (read.node.hiddenSides(k) & kHiddenFront) != 0;
        pieces += is_behind;
        const glm::vec3 light =
            read.node.isFlat() ? read.node.radiosity : read.node.facets[k].radiosity;
        EXPECT_NEAR(light.x, is_behind ? 0 : 1, 1e-3);
      }
    }
    EXPECT_GT(pieces, 10);
  }
}

// Cells of 16 spacings end between the sheets somewhere, at one height or another.
TEST_F(HiddenNodes, AreFoundAcrossCells) {
  for (const float gap : {.5f, 2.f, 4.f}) {
    // Who looks aslant sees those as near to the edge as the sheets are apart
    const double side = gap < 1.5f ? 40 : 40 - 2 * double(gap);
    for (float height = .1f; height < 16; height += .9f * gap) {
      std::vector<Surfel> cloud = together(sheet(40, height), sheet(40, height - gap));
      for (const float end : {-20.f, 40.f}) cloud = together(cloud, sheet(1, end));  // of the cube
      const Result<ReadScene> scene = readScene(index(cloud));
      ASSERT_TRUE(scene.ok()) << scene.status().message();
      EXPECT_GE(double(hiddenCount(scene->surfels)), .95 * side * side) << height << ' ' << gap;
    }
  }
}

TEST_F(HiddenNodes, ScenesWithoutLayersHaveNone) {
  const Result<ReadScene> scene = readScene(index(sheet(40, 0)));
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_FALSE(scene->header.has_layers);
}

}  // namespace
}  // namespace surfeit
