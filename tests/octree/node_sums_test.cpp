#include "octree/node/node_sums.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/long_side.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// Sums made by a tree: of halves, of halves.
NodeSums sumsOf(std::span<const Surfel> cloud) {
  NodeSums sums;
  if (cloud.size() <= 3) {
    for (const Surfel& surfel : cloud) sums.add(surfel);
    return sums;
  }
  sums.add(sumsOf(cloud.first(cloud.size() / 2)));
  sums.add(sumsOf(cloud.subspan(cloud.size() / 2)));
  return sums;
}

// Points of each disk, from which its surfel's moments follow by definition.
struct Moments {
  double area = 0;
  glm::dvec3 mean{0};
  double covariance[3][3] = {}, front[3][3] = {};
};

Moments momentsOfPoints(std::span<const Surfel> cloud) {
  Moments moments;
  for (const Surfel& surfel : cloud) {
    moments.area += double(surfel.area);
    moments.mean += double(surfel.area) * glm::dvec3(surfel.position);
  }
  moments.mean /= moments.area;
  for (const Surfel& surfel : cloud) {
    const glm::dvec3 x = glm::dvec3(surfel.position) - moments.mean, n(surfel.normal);
    // A disk of area A = pi r^2 has the covariance r^2 / 4 along each axis of its plane
    const double disk = double(surfel.area) / double(4 * kPi);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const double spread = disk * ((i == j ? 1 : 0) - n[i] * n[j]);
        moments.covariance[i][j] += double(surfel.area) * (x[i] * x[j] + spread) / moments.area;
        if (surfel.isSphere() || surfel.isTwoSided()) continue;
        moments.front[i][j] += double(surfel.area) * x[i] * n[j];
      }
    }
  }
  return moments;
}

void expectMoments(std::span<const Surfel> cloud, float tolerance) {
  const Node node = sumsOf(cloud).toNode(1, 1);
  const Moments expected = momentsOfPoints(cloud);
  const double size =
      std::sqrt(expected.covariance[0][0] + expected.covariance[1][1] + expected.covariance[2][2]);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(double(node.covariance(i, j)), expected.covariance[i][j],
                  double(tolerance) * size * size);
      EXPECT_NEAR(double(node.rough.front_moment[std::size_t(i)][j]), expected.front[i][j],
                  double(tolerance) * size * expected.area);
    }
  }
}

TEST(NodeSums, MomentsAreThoseOfTheDisks) {
  expectMoments(randomCloud(300), 1e-6f);
  expectMoments(planeCloud(8, .1f), 1e-6f);
  expectMoments(sphereCloud(500), 1e-6f);
}

TEST(NodeSums, MomentsFarFromTheOriginLoseNothing) {
  // A scan of a square metre in the coordinates of a country, and a speck a thousand miles away
  expectMoments(moved(randomCloud(300), 1, {512000, 5400000, 300}), 1e-6f);
  expectMoments(moved(sphereCloud(200), 1e-3f, {0, 1e6f, 0}), 1e-5f);
}

TEST(NodeSums, ADiskLargerThanItsRadiusSpreadsNoFartherThanThat) {
  Surfel surfel;
  surfel.normal = {0, 0, 1};
  surfel.radius = 2;
  surfel.area = 1000;
  NodeSums sums;
  sums.add(surfel);
  const Node node = sums.toNode(1, 1);
  EXPECT_FLOAT_EQ(node.covariance(0, 0), 1);
  EXPECT_FLOAT_EQ(node.covariance(2, 2), 0);
}

TEST(NodeSums, WhatHasALongSideSpreadsAsARectangle) {
  for (const bool is_two_sided : {false, true}) {
    Surfel surfel;
    surfel.normal = glm::normalize(glm::vec3(1, 0, 2));
    surfel.area = 4;
    surfel.radius = 3;
    if (is_two_sided) surfel.flags |= kSurfelTwoSided;
    setLongSide({0, 6, 0}, surfel);
    NodeSums sums;
    sums.add(surfel);
    const SymmetricMatrix found = sums.toNode(1, 3).covariance;
    const glm::vec3 across = glm::cross(surfel.normal, glm::vec3(0, 1, 0));
    // By the codes of a direction and an elongation
    EXPECT_NEAR(quadraticForm(found, {0, 1, 0}), 36.f / 12, .05f);
    EXPECT_NEAR(quadraticForm(found, across), 4.f / 9 / 12, .005f);
    EXPECT_NEAR(quadraticForm(found, surfel.normal), 0, 1e-4f);
  }
}

TEST(NodeSums, Band4GivesTheFourthMomentOfTheNormals) {
  const std::vector<Surfel> cloud = randomCloud(200);
  const Node node = sumsOf(cloud).toNode(1, 1);
  TestRandom random(9);
  for (int i = 0; i < 20; ++i) {
    const glm::vec3 d = random.direction();
    double expected = 0;
    for (const Surfel& surfel : cloud) {
      if (surfel.isSphere()) continue;
      const double x = double(glm::dot(d, surfel.normal));
      const double p4 = (35 * x * x * x * x - 30 * x * x + 3) / 8;
      expected += double(surfel.area) * (surfel.isTwoSided() ? 2 : 1) * p4;
    }
    EXPECT_NEAR(double(shEvaluate(node.rough.area_band_4, shBand4(d))), expected,
                1e-5 * double(node.area));
  }
}

// Centre, area and light of each face of a box, in whatever order.
TEST(NodeSums, ABoxHasItsFacesAsFacets) {
  for (const int faces : {2, 3, 5, 6}) {
    const NodeSums sums = sumsOf(boxCloud(8, .1f, faces));
    const Node node = sums.toNode(.97f, radiusOfBox(sums.centre(), sums.disk_bounds));
    ASSERT_EQ(node.facet_count, faces);
    std::uint32_t found = 0;
    for (std::size_t k = 0; k < node.facet_count; ++k) {
      const Facet facet = node.facet(k);
      const auto face = static_cast<int>(facet.radiosity.x - .5f);
      found |= 1u << face;
      glm::vec3 normal(0), middle(.35f);
      normal[face % 3] = face < 3 ? 1.f : -1.f;
      middle[face % 3] = face < 3 ? .75f : -.05f;
      EXPECT_LT(glm::length(facet.normal - normal), 1e-4f);
      EXPECT_LT(glm::length(facet.position - middle), .01f * node.radius);
      EXPECT_NEAR(facet.area, node.area / float(faces), 1e-4f * node.area);
      // A square of 0.8, by its surfels' middles and what their disks spread
      const float along = quadraticForm(facet.covariance, glm::vec3(1) - glm::abs(normal)) / 2;
      EXPECT_NEAR(along, .64f / 12, .15f * .64f / 12);
      EXPECT_NEAR(quadraticForm(facet.covariance, normal), 0, .003f * .64f);
    }
    EXPECT_EQ(found, (1u << faces) - 1);
  }
}

TEST(NodeSums, WhatCurvesSlowlyHasFewFacetsAndWhatFacesManyWaysNone) {
  // A quarter of a cylinder: three pieces of 30 degrees are flat enough, two of 45 are not
  std::vector<Surfel> cloud;
  for (const Surfel& flat : planeCloud(30, .1f)) {
    Surfel surfel = flat;
    const float angle = flat.position.x / 2.9f * kPi / 2;
    surfel.normal = {std::cos(angle), 0, std::sin(angle)};
    surfel.position = {surfel.normal.x, flat.position.y, surfel.normal.z};
    cloud.push_back(surfel);
  }
  const Node node = sumsOf(cloud).toNode(.97f, 3);
  EXPECT_GE(node.facet_count, 2);
  EXPECT_LE(node.facet_count, 4);
  EXPECT_EQ(sumsOf(sphereCloud(2000)).toNode(.97f, 2).facet_count, 0);
  cloud = boxCloud(4, .1f);
  cloud[50].flags = kSurfelTwoSided;
  EXPECT_TRUE(sumsOf(cloud).toNode(.97f, 2).isRough());
}

// Two-sided surfels of a plane are flat whichever way each is turned; opposite walls stay apart,
// and what faces one way stays apart from what faces both.
TEST(NodeSums, TwoSidedSurfelsHaveFacetsOfTheirOwn) {
  std::vector<Surfel> cloud = planeCloud(8, .1f);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud[i].flags = kSurfelTwoSided;
    if (i % 3 == 0) cloud[i].normal = -cloud[i].normal;
  }
  Node node = sumsOf(cloud).toNode(.97f, 1);
  ASSERT_TRUE(node.isFlat() && node.isTwoSided());
  EXPECT_NEAR(std::abs(node.normal.z), 1, 1e-6f);
  EXPECT_NEAR(node.flatness, 1, 1e-6f);

  cloud = boxCloud(8, .1f);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (i % 64 < 32) cloud[i].normal = -cloud[i].normal;  // half of each wall
    cloud[i].flags = kSurfelTwoSided | kSurfelLoose;
  }
  NodeSums sums = sumsOf(cloud);
  node = sums.toNode(.97f, radiusOfBox(sums.centre(), sums.disk_bounds));
  ASSERT_EQ(node.facet_count, 6);
  for (std::size_t k = 0; k < node.facet_count; ++k) {
    EXPECT_TRUE(node.facet(k).is_two_sided && node.facet(k).is_thicket);
    EXPECT_NEAR(node.facet(k).area, node.area / 6, 1e-4f * node.area);
    EXPECT_NEAR(glm::length(node.facet(k).normal), 1, 1e-4f);
  }

  cloud = planeCloud(8, .1f);
  for (std::size_t i = 0; i < 16; ++i) cloud[i].flags = kSurfelTwoSided;
  node = sumsOf(cloud).toNode(.97f, 1);
  ASSERT_EQ(node.facet_count, 2);
  EXPECT_NE(node.facet(0).is_two_sided, node.facet(1).is_two_sided);
  const Facet two_sided = node.facet(node.facet(0).is_two_sided ? 0 : 1);
  EXPECT_NEAR(two_sided.area, node.area / 4, 1e-4f * node.area);
}

// The mean of a wall and a pane would hide as neither does, however they face.
TEST(NodeSums, OpaqueAndTranslucentSurfelsHaveFacetsOfTheirOwn) {
  for (const int flags : {0, int(kSurfelTwoSided)}) {
    for (const float opacity : {.1f, .5f, .99f}) {
      std::vector<Surfel> cloud = planeCloud(8, .1f);
      for (Surfel& surfel : cloud) surfel.flags = std::uint16_t(flags);
      const Node opaque = sumsOf(cloud).toNode(.97f, 1);
      EXPECT_TRUE(opaque.isFlat() && !opaque.isTranslucent());
      for (std::size_t i = 0; i < 16; ++i) cloud[i].setOpacity(opacity, opacity, 1);
      const Node node = sumsOf(cloud).toNode(.97f, 1);
      ASSERT_EQ(node.facet_count, 2);
      const std::size_t clear = node.facets[0].isTranslucent() ? 0 : 1;
      EXPECT_EQ(node.facets[1 - clear].opacity(), glm::vec3(1));
      EXPECT_NEAR(node.facets[clear].opacity().x, opacity, 1e-4f);
      EXPECT_EQ(node.facets[clear].opacity().z, 1);
      EXPECT_NEAR(node.facet(clear).area, node.area / 4, 1e-4f * node.area);
      for (Surfel& surfel : cloud) surfel.setOpacity(opacity, opacity, 1);
      EXPECT_TRUE(sumsOf(cloud).toNode(.97f, 1).isFlat());
    }
  }
}

TEST(NodeSums, AFlatNodeHasNoFrontMoment) {
  const Node node = sumsOf(planeCloud(8, .1f)).toNode(.97f, 1);
  ASSERT_TRUE(node.isFlat());
  for (const glm::vec3& row : node.rough.front_moment) EXPECT_EQ(row, glm::vec3(0));
  for (const float value : node.rough.area_band_4) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace surfeit
