// How the radiosity of a piece follows the direction in which its surfels face: by definition,
// through a file, and after relight.
#include "octree/node/radiosity_slope.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "octree/build/scene_writer.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

constexpr float kStep = RadiositySlope::kMost / 127;

// A cap of a sphere around z, of all directions within so many radians, as bright as they say.
template <typename Brightness>
std::vector<Surfel> capOf(float angle, const Brightness& brightness) {
  std::vector<Surfel> surfels;
  constexpr int kCount = 4000;
  for (int i = 0; i < kCount; ++i) {
    // Even in area, on a spiral
    const float z = 1 - (1 - std::cos(angle)) * (float(i) + .5f) / kCount;
    const float turn = 2.39996f * float(i), across = std::sqrt(1 - z * z);
    Surfel& surfel = surfels.emplace_back();
    surfel.normal = {across * std::cos(turn), across * std::sin(turn), z};
    surfel.position = surfel.normal;
    surfel.area = 1e-3f;
    surfel.radius = .02f;
    surfel.radiosity = brightness(surfel.normal) * glm::vec3(1, .5f, .25f);
  }
  return surfels;
}

void expectSlope(const RadiositySlope& slope, const glm::vec3& expected, float most) {
  for (std::size_t color = 0; color < 3; ++color) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(slope.value(color)[axis], expected[axis], most) << color << " " << axis;
    }
  }
}

TEST(RadiositySlope, IsNoneOfWhatShinesEvenlyOrNotOrIsPlane) {
  EXPECT_TRUE(nodeOf(capOf(.3f, [](auto) { return 1.f; })).slopes[0].isNone());
  EXPECT_TRUE(nodeOf(capOf(.3f, [](auto) { return 0.f; })).slopes[0].isNone());
  EXPECT_TRUE(nodeOf(capOf(.005f, [](auto n) { return 1 + 100 * n.x; })).slopes[0].isNone());
}

TEST(RadiositySlope, IsThatOfBrightnessOverNormals) {
  for (const float angle : {.1f, .2f, .3f}) {
    const glm::vec3 mean = nodeOf(capOf(angle, [](auto) { return 1.f; })).normal *
                           nodeOf(capOf(angle, [](auto) { return 1.f; })).flatness;
    const float range = std::sqrt(1.5f * (1 - glm::dot(mean, mean)));
    for (const glm::vec3& slope : {glm::vec3(.5f, 0, 0), glm::vec3(-.3f, .6f, 0)}) {
      const Node node =
          nodeOf(capOf(angle, [&](auto n) { return 3 + 3 * glm::dot(slope, n - mean) / range; }));
      ASSERT_TRUE(node.isFlat());
      EXPECT_NEAR(node.radiosity.x, 3, .01f);
      expectSlope(node.slopes[0], slope, kStep);
    }
  }
}

TEST(RadiositySlope, IsOfEachColorByItself) {
  std::vector<Surfel> cap = capOf(.2f, [](auto) { return 1.f; });
  for (Surfel& surfel : cap) surfel.radiosity = {1 + surfel.normal.x, 1 - surfel.normal.x, 0};
  const RadiositySlope slope = nodeOf(cap).slopes[0];
  EXPECT_GT(slope.value(0).x, .1f);
  EXPECT_NEAR(slope.value(1).x, -slope.value(0).x, 1e-6f);
  EXPECT_EQ(slope.value(2), glm::vec3(0));
}

// Spheres and two-sided surfels in a flat node may have most of its power.
TEST(RadiositySlope, ComesFromNothingThatFacesNowhere) {
  for (const auto flag : {kSurfelSphere, kSurfelTwoSided}) {
    std::vector<Surfel> cap = capOf(.2f, [](auto) { return 1.f; });
    for (std::size_t i = 0; i < cap.size(); i += 100) {
      cap[i].flags |= flag;
      cap[i].radiosity = glm::vec3(1e4f);
    }
    const Node node = nodeOf(cap);
    ASSERT_TRUE(node.isFlat() && !node.isTwoSided());
    EXPECT_GT(node.radiosity.x, 50);
    expectSlope(node.slopes[0], glm::vec3(0), 2 * kStep);
  }
}

TEST(RadiositySlope, TurnsWithTheSideOfTwoSidedSurfels) {
  const auto brightness = [](const glm::vec3& n) { return 1 + n.x; };
  std::vector<Surfel> cap = capOf(.2f, brightness);
  const glm::vec3 expected = nodeOf(cap).slopes[0].value(0);
  EXPECT_GT(expected.x, .1f);
  for (std::size_t i = 0; i < cap.size(); ++i) {
    cap[i].flags |= kSurfelTwoSided;
    if (i % 3 != 0) cap[i].normal = -cap[i].normal;
  }
  const Node node = nodeOf(cap);
  ASSERT_TRUE(node.isFlat() && node.isTwoSided());
  expectSlope(node.slopes[0], (node.normal.z > 0 ? 1.f : -1.f) * expected, 2 * kStep);
}

TEST(RadiositySlope, IsOfEachFacetByItself) {
  std::vector<Surfel> both = capOf(.2f, [](auto n) { return 1 + n.x; });
  const glm::vec3 expected = nodeOf(both).slopes[0].value(0);
  const std::vector<Surfel> even = capOf(.2f, [](auto) { return 9.f; });
  for (Surfel surfel : even) {
    std::swap(surfel.normal.x, surfel.normal.z);
    both.push_back(surfel);
  }
  const Node node = nodeOf(both);
  ASSERT_EQ(node.facet_count, 2);
  const std::size_t bright = node.facets[0].normal[0] > node.facets[1].normal[0] ? 0 : 1;
  expectSlope(node.slopes[1 - bright], expected, 2 * kStep);
  EXPECT_TRUE(node.slopes[bright].isNone());
}

class RadiositySlopeOfFiles : public SceneTest {};

TEST_F(RadiositySlopeOfFiles, IsStoredForEveryPiece) {
  const std::vector<Surfel> cloud =
      capOf(3.1f, [](auto n) { return std::max(0.f, n.x + .3f * n.y); });
  for (const bool full_precision : {false, true}) {
    IndexOptions options;
    options.full_precision = full_precision;
    const std::string scene = index(cloud, kAllChannels, options);
    EXPECT_THAT(findingsOf(scene), testing::IsEmpty());
    const Result<ReadScene> read = readScene(scene);
    ASSERT_TRUE(read.ok()) << read.status().message();
    EXPECT_TRUE(read->header.has_slopes);
    std::size_t flat = 0, facets = 0;
    for (const auto& [node, first] : read->nodes) {
      const Node expected =
          nodeOf(std::span(read->surfels).subspan(std::size_t(first), node.surfel_count));
      if (node.isFlat() && expected.isFlat() && !expected.slopes[0].isNone()) {
        expectSlope(node.slopes[0], expected.slopes[0].value(0), .1f);
        flat += node.slopes[0].isNone() ? 0 : 1;
      }
      for (std::size_t k = 0; k < node.facet_count; ++k) facets += !node.slopes[k].isNone();
    }
    EXPECT_GT(flat, 50u);
    EXPECT_GT(facets, 10u);
  }
}

TEST_F(RadiositySlopeOfFiles, IsLeftOutWithoutRadiosities) {
  CloudChannels channels = kAllChannels;
  channels.radiosity = false;
  const auto cap = capOf(3.1f, [](auto n) { return 1 + n.x; });
  const Result<ReadScene> read = readScene(index(cap, channels));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_FALSE(read->header.has_slopes);
  for (const auto& [node, first] : read->nodes) EXPECT_TRUE(node.slopes[0].isNone());
}

}  // namespace
}  // namespace surfeit
