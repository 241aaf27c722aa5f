// How differently the surfels of a node shine: by definition, through a file, and after relight.
#include "octree/node/radiosity_variance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octree/build/scene_writer.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A grid over x and y, facing z.
std::vector<Surfel> floorOf(int across) {
  std::vector<Surfel> surfels;
  for (int i = 0; i < across * across; ++i) {
    Surfel& surfel = surfels.emplace_back();
    surfel.position = {float(i % across), float(i / across), 0};
    surfel.normal = {0, 0, 1};
    surfel.area = 1;
    surfel.radius = .71f;
    surfel.radiosity = glm::vec3(1);
  }
  return surfels;
}

TEST(RadiosityVariance, IsNoneOfWhatShinesEvenlyOrNot) {
  std::vector<Surfel> floor = floorOf(4);
  EXPECT_NEAR(nodeOf(floor).radiosity_variance, 0, 1e-6);
  for (Surfel& surfel : floor) surfel.radiosity = glm::vec3(0);
  EXPECT_EQ(nodeOf(floor).radiosity_variance, 0);
}

// The mean of the squares over the square of the mean is one over the part that shines.
TEST(RadiosityVariance, TellsThePartThatShines) {
  for (const int lit : {1, 2, 8, 32, 63}) {
    std::vector<Surfel> floor = floorOf(8);
    for (std::size_t i = std::size_t(lit); i < floor.size(); ++i) {
      floor[i].radiosity = glm::vec3(0);
    }
    EXPECT_NEAR(nodeOf(floor).radiosity_variance, 64. / lit - 1, 1e-4 * 64 / lit) << lit;
  }
}

TEST(RadiosityVariance, CountsEveryColor) {
  std::vector<Surfel> floor = floorOf(4);
  for (std::size_t i = 0; i < floor.size(); ++i) {
    floor[i].radiosity = i % 2 == 0 ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  }
  EXPECT_NEAR(nodeOf(floor).radiosity_variance, 1, 1e-5);
}

TEST(RadiosityVariance, WeighsByAreaAndOpacity) {
  std::vector<Surfel> two = floorOf(2);
  two.resize(2);
  two[0].area = 3;
  two[1].radiosity = glm::vec3(5);
  two[1].transparency = transparencyOf(.5);
  // 3 of 1 and 1/2 of 5: mean 5.5 / 3.5, of the squares 15.5 / 3.5
  const double mean = 5.5 / 3.5, squares = 15.5 / 3.5;
  NodeSums sums;
  for (const Surfel& surfel : two) sums.add(surfel);
  EXPECT_NEAR(RadiosityVariance::of(sums), squares / (mean * mean) - 1, 1e-4);
}

// Each wall of a corner is drawn in its own color.
TEST(RadiosityVariance, IsWithinPiecesNotBetweenThem) {
  std::vector<Surfel> corner = floorOf(4);
  for (int i = 0; i < 16; ++i) {
    Surfel wall = corner[std::size_t(i)];
    std::swap(wall.position.x, wall.position.z);
    wall.normal = {1, 0, 0};
    wall.radiosity = glm::vec3(9);
    corner.push_back(wall);
  }
  Node node = nodeOf(corner);
  ASSERT_EQ(node.facet_count, 2);
  EXPECT_NEAR(node.radiosity_variance, 0, 1e-5);
  for (int i = 0; i < 8; ++i) corner[std::size_t(i)].radiosity = glm::vec3(0);  // half of the floor
  node = nodeOf(corner);
  // Sums of squares over sums of squares of means: (8 + 16 * 81) / (16 / 4 + 16 * 81)
  EXPECT_NEAR(node.radiosity_variance, (8. + 16 * 81) / (4. + 16 * 81) - 1, 1e-5);
}

TEST(RadiosityVariance, CodesAreWithin2PercentOfAll) {
  for (float variance = 1e-3f; variance < 6e4f; variance *= 1.37f) {
    const float found = varianceOf(varianceCode(variance));
    EXPECT_NEAR((1 + found) / (1 + variance), 1, .0225) << variance;
  }
  EXPECT_EQ(varianceOf(varianceCode(0)), 0);
  EXPECT_EQ(varianceOf(varianceCode(-1)), 0);
  EXPECT_EQ(varianceOf(varianceCode(std::nanf(""))), 0);
  EXPECT_EQ(varianceCode(kInfinity), 255);
  EXPECT_EQ(varianceCode(1e30f), 255);
}

class RadiosityVarianceOfFiles : public SceneTest {};

TEST_F(RadiosityVarianceOfFiles, IsStoredForEveryNode) {
  std::vector<Surfel> cloud = floorOf(40);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud[i].radiosity = glm::vec3(i % 7 < 2 || i > 1200 ? .01f : 3.f, .2f, float(i % 40) / 40);
  }
  for (const bool full_precision : {false, true}) {
    IndexOptions options;
    options.full_precision = full_precision;
    const std::string scene = index(cloud, kAllChannels, options);
    EXPECT_THAT(findingsOf(scene), testing::IsEmpty());
    const Result<ReadScene> read = readScene(scene);
    ASSERT_TRUE(read.ok()) << read.status().message();
    EXPECT_TRUE(read->header.has_variances);
    std::size_t uneven = 0;
    for (const ReadScene::ReadNode& one : read->nodes) {
      const auto below = std::span(read->surfels).subspan(one.first_surfel, one.node.surfel_count);
      const double expected = double(nodeOf(below).radiosity_variance);
      EXPECT_NEAR((1 + double(one.node.radiosity_variance)) / (1 + expected), 1, .03);
      uneven += one.node.radiosity_variance > .1f;
    }
    EXPECT_GT(uneven, 20u);
  }
}

TEST_F(RadiosityVarianceOfFiles, IsLeftOutWithoutRadiosities) {
  CloudChannels channels = kAllChannels;
  channels.radiosity = false;
  const Result<ReadScene> read = readScene(index(floorOf(20), channels));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_FALSE(read->header.has_variances);
  for (const ReadScene::ReadNode& one : read->nodes) EXPECT_EQ(one.node.radiosity_variance, 0);
}

}  // namespace
}  // namespace surfeit
