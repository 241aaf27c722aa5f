#include "gather/rules/contribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "gather/rules/coverage_rules.h"
#include "octree/node/node_sums.h"

namespace surfeit {
namespace {

ShCoefficients projectLobes(std::span<const glm::vec3> normals, const ZonalFactors& factors) {
  ShCoefficients sum{};
  for (const glm::vec3& normal : normals) {
    const ShCoefficients basis = shBasis(normal);
    for (std::size_t i = 0; i < kShCount; ++i)
      sum[i] += factors[std::size_t(kShBand[i])] * basis[i];
  }
  return sum;
}

// What a node has of band 4 of these normals, with weights of 1.
ShCoefficients projectBand4(std::span<const glm::vec3> normals) {
  ShCoefficients sum{};
  for (const glm::vec3& normal : normals) {
    const ShCoefficients basis = shBand4(normal);
    for (std::size_t i = 0; i < kShCount; ++i) sum[i] += 4 * kPi / 9 * basis[i];
  }
  return sum;
}

std::vector<glm::vec3> evenDirections(int count) {
  std::vector<glm::vec3> directions;
  for (int i = 0; i < count; ++i) {
    const float z = 1 - float(2 * i + 1) / float(count), phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    directions.push_back({rho * std::cos(phi), rho * std::sin(phi), z});
  }
  return directions;
}

// A node of `count` surfels of area 1 and the given normals and radiosity, two away along z.
Node makeNode(std::span<const glm::vec3> normals, const glm::vec3& radiosity) {
  Node node{};
  node.position = {0, 0, 2};
  node.radius = 1;
  node.forgetBounds();
  glm::vec3 sum(0);
  for (const glm::vec3& normal : normals) sum += normal;
  node.area = 1;
  node.flatness = glm::length(sum) / float(normals.size());
  node.normal = glm::length(sum) > 0 ? glm::normalize(sum) : glm::vec3(0);
  node.radiosity = radiosity;
  node.covariance = (1 / 3.f) * withoutDirection(glm::vec3(0));  // as of a shell
  const ShCoefficients lobes = projectLobes(normals, kClampedCosine);
  const ShCoefficients fourth = projectBand4(normals);
  for (std::size_t i = 0; i < kShCount; ++i) {
    node.rough.area_band_4[i] = fourth[i] / float(normals.size());
    node.rough.sh[i][kAreaKind] = lobes[i] / float(normals.size());
    for (int c = 0; c < 3; ++c)
      node.rough.sh[i][powerKind(c)] = node.rough.sh[i][kAreaKind] * radiosity[c];
  }
  return node;
}

TEST(ProjectedSum, IsExactForASingleNormal) {
  for (const glm::vec3& normal : evenDirections(50)) {
    const ShCoefficients lobe = projectLobes(std::span(&normal, 1), kClampedCosine);
    for (const glm::vec3& direction : evenDirections(60)) {
      float opposite;
      const float facing = projectedSum(lobe, shBasis(direction), opposite);
      const float cosine = glm::dot(normal, direction);
      EXPECT_NEAR(facing, std::max(0.f, cosine), 2e-3);
      EXPECT_NEAR(opposite, std::max(0.f, -cosine), 2e-3);
    }
  }
}

TEST(ProjectedSum, IsExactForEvenlySpreadNormalsAndForSpheres) {
  const std::vector<glm::vec3> normals = evenDirections(1000);
  const ShCoefficients convex = projectLobes(normals, kClampedCosine);
  const glm::vec3 any{0, 0, 1};
  const ShCoefficients sphere = projectLobes(std::span(&any, 1), kConstant);
  for (const glm::vec3& direction : evenDirections(60)) {
    float opposite;
    EXPECT_NEAR(projectedSum(convex, shBasis(direction), opposite), 250, 1);
    EXPECT_NEAR(projectedSum(sphere, shBasis(direction), opposite), 1, 1e-4);
  }
}

TEST(ProjectedSum, ErrsByAFewPercentForABox) {
  const glm::vec3 normals[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  const ShCoefficients box = projectLobes(normals, kClampedCosine);
  for (const glm::vec3& d : evenDirections(60)) {
    float opposite;
    const float expected = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
    EXPECT_NEAR(projectedSum(box, shBasis(d), opposite), expected, .5);  // 1.5, of 1 to 1.73
  }
}

TEST(ProjectedSum, IsNeverNegativeAndSidesDifferByTheMean) {
  const std::vector<glm::vec3> all = evenDirections(97);
  for (std::size_t count = 1; count < all.size(); count += 7) {
    const std::span<const glm::vec3> normals(all.data(), count);  // ever wider caps around z
    const ShCoefficients sum = projectLobes(normals, kClampedCosine);
    for (const glm::vec3& direction : evenDirections(60)) {
      float opposite, mean = 0;
      const float facing = projectedSum(sum, shBasis(direction), opposite);
      for (const glm::vec3& normal : normals) mean += glm::dot(normal, direction);
      EXPECT_GE(facing, 0);
      EXPECT_GE(opposite, -1e-4f);
      EXPECT_NEAR(facing - opposite, mean, 1e-3);
    }
  }
}

FacingAreas facingOf(std::span<const glm::vec3> normals, const glm::vec3& to_receiver) {
  return facingAreas(makeNode(normals, {1, 1, 1}), to_receiver);
}

TEST(FacingAreas, AreExactForFacesThatAreSeenAlike) {
  const glm::vec3 slab[] = {{0, 0, 1}, {0, 0, -1}};
  const glm::vec3 box[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  for (const glm::vec3& d : evenDirections(60)) {
    EXPECT_NEAR(facingOf(slab, d).front, std::abs(d.z) / 2, 1e-3);
    EXPECT_NEAR(facingOf(slab, d).back, std::abs(d.z) / 2, 1e-3);
    EXPECT_NEAR(facingOf(std::span(slab, 1), d).front, std::max(0.f, d.z), 1e-3);
    EXPECT_NEAR(facingOf(std::span(slab, 1), d).back, std::max(0.f, -d.z), 1e-3);
    // Head-on to a face of the box, and to a corner; in between 10 % at most
    const float expected = (std::abs(d.x) + std::abs(d.y) + std::abs(d.z)) / 6;
    EXPECT_NEAR(facingOf(box, d).front, expected, .1f * expected);
  }
  EXPECT_NEAR(facingOf(box, {0, 1, 0}).front, 1 / 6.f, 1e-3);
  EXPECT_NEAR(facingOf(box, glm::normalize(glm::vec3(1, -1, 1))).front, std::sqrt(3.f) / 6, 1e-3);
}

TEST(FacingAreas, AreExactForEvenlySpreadNormalsAndForSpheres) {
  const std::vector<glm::vec3> normals = evenDirections(1000);
  Surfel ball;
  ball.radius = 1;
  ball.area = 2;
  ball.flags = kSurfelSphere;
  NodeSums sums;
  sums.add(ball);
  const Node sphere = sums.toNode(.97f, 1);
  for (const glm::vec3& d : evenDirections(20)) {
    EXPECT_NEAR(facingOf(normals, d).front, .25f, 2e-3);
    EXPECT_NEAR(facingAreas(sphere, d).front, 2, .01);
    EXPECT_NEAR(facingAreas(sphere, d).back, 2, .01);
  }
}

TEST(FacingAreas, AreNeverNegativeAndDifferByTheMean) {
  const std::vector<glm::vec3> all = evenDirections(97);
  for (std::size_t count = 1; count < all.size(); count += 7) {
    const std::span<const glm::vec3> normals(all.data(), count);  // ever wider caps around z
    for (const glm::vec3& direction : evenDirections(60)) {
      const FacingAreas facing = facingOf(normals, direction);
      float mean = 0, front = 0;
      for (const glm::vec3& normal : normals) {
        mean += glm::dot(normal, direction) / float(count);
        front += std::max(0.f, glm::dot(normal, direction)) / float(count);
      }
      EXPECT_GE(facing.front, 0);
      EXPECT_GE(facing.back, 0);
      EXPECT_NEAR(facing.front - facing.back, mean, 1e-3);
      EXPECT_NEAR(facing.front, front, .03f);
    }
  }
}

TEST(FacingAreas, OfDamagedMomentsAreNumbers) {
  for (const float total : {0.f, 1e-38f, 1.f}) {
    for (const float second : {-2.f, -.5f, 0.f, 1.f, 3.f}) {
      for (const float fourth : {-2.f, -.4f, 0.f, 1.f, 3.f}) {
        const FacingAreas facing = facingAreas(total, 0, second * total, fourth * total);
        EXPECT_TRUE(!(facing.front < 0) && !(facing.front > 1)) << total;
      }
    }
  }
}

TEST(NodeContribution, FlatNodeIsADisk) {
  const glm::vec3 normal{0, 0, -1};
  Node node = makeNode(std::span(&normal, 1), {3, 2, 1});
  node.flags = kNodeFlat;
  node.rough.sh = {};
  Contribution patch;
  ASSERT_TRUE(makeContribution(node, node.position, {}, patch));
  EXPECT_FLOAT_EQ(patch.solid_angle, .25f);
  EXPECT_FLOAT_EQ(patch.distance_sq, 4);
  EXPECT_FLOAT_EQ(patch.direction.z, 1);
  EXPECT_FLOAT_EQ(patch.radiosity.x, 3);

  // From behind: nothing, or black
  EXPECT_FALSE(makeContribution(node, -node.position, {}, patch));
  ASSERT_TRUE(makeContribution(node, -node.position, {GatherSides::kBoth, true}, patch));
  EXPECT_FLOAT_EQ(patch.solid_angle, .25f);
  EXPECT_EQ(patch.radiosity, glm::vec3(0));
}

TEST(NodeContribution, RoughNodeShowsAQuarterOfItsAreaOnAverage) {
  const Node node = makeNode(evenDirections(500), {3, 2, 1});
  Contribution patch;
  ASSERT_TRUE(makeContribution(node, node.position, {}, patch));
  EXPECT_NEAR(patch.solid_angle, 1.f / 16, 1e-3);
  EXPECT_NEAR(patch.radiosity.x, 3, .02);
  ASSERT_TRUE(makeContribution(node, node.position, {GatherSides::kBoth, true}, patch));
  EXPECT_NEAR(patch.solid_angle, 2.f / 16, 1e-3);
  EXPECT_NEAR(patch.radiosity.x, 1.5, .02);  // half of what covers is black
}

TEST(NodeContribution, FrontsOverlapWhereBacksPrevail) {
  std::vector<glm::vec3> normals;  // of a bumpy sheet that faces +z
  for (const glm::vec3& direction : evenDirections(500)) {
    normals.push_back(glm::normalize(direction + glm::vec3(0, 0, .4f)));
  }
  const Node node = makeNode(normals, {1, 1, 1});
  Contribution patch;
  ASSERT_TRUE(makeContribution(node, {0, 0, 2}, {}, patch));  // from behind
  EXPECT_EQ(patch.overlap, 1);
  ASSERT_TRUE(makeContribution(node, {0, 0, -2}, {}, patch));
  EXPECT_EQ(patch.overlap, 0);
  ASSERT_TRUE(makeContribution(node, {0, 0, 2}, {GatherSides::kBoth, true}, patch));
  EXPECT_EQ(patch.overlap, 0);
}

TEST(NodeContribution, NeverExceedsTheOutlineOfItsSphere) {
  Node node = makeNode(evenDirections(500), {1, 1, 1});
  node.radius = .1f;
  node.forgetBounds();
  node.covariance = .01f * node.covariance;
  Contribution patch;
  ASSERT_TRUE(makeContribution(node, node.position, {}, patch));
  EXPECT_FLOAT_EQ(patch.solid_angle, kPi * .01f / 4);
  EXPECT_NEAR(patch.radiosity.x, 1, .01);
}

// A rough node of small surfels at these places with these normals.
Node nodeOf(std::span<const glm::vec3> positions, std::span<const glm::vec3> normals) {
  NodeSums sums;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    Surfel surfel;
    surfel.position = positions[i];
    surfel.normal = normals[i];
    surfel.radius = 1e-3f;
    surfel.area = 1e-6f;
    sums.add(surfel);
  }
  float radius = 0;
  for (const glm::vec3& position : positions) {
    radius = std::max(radius, glm::length(position - sums.centre()));
  }
  return sums.toNode(1, radius);
}

// The middle of what is seen of a node, along v from its position towards the receiver.
glm::vec3 middleOfSeen(const Node& node, const glm::vec3& v, GatherSides sides) {
  return seenPart(node, -100.f * v, facingAreas(node, v), sides).middle;
}

TEST(RoughNode, OfASphereTheCapTowardsTheReceiverIsSeen) {
  const std::vector<glm::vec3> all = evenDirections(2000);
  const Node node = nodeOf(all, all);
  for (const glm::vec3& v : evenDirections(20)) {
    const glm::vec3 front = middleOfSeen(node, v, GatherSides::kFront);
    EXPECT_LT(glm::length(front - 2 / 3.f * v), .01f);
    const glm::vec3 back = middleOfSeen(node, v, GatherSides::kBack);
    EXPECT_LT(glm::length(back + 2 / 3.f * v), .01f);
    EXPECT_LT(glm::length(middleOfSeen(node, v, GatherSides::kBoth)), .01f);
  }
}

TEST(RoughNode, OfAnEdgeTheFaceThatShowsIsSeen) {
  // Two unit squares that meet at right angles along y
  std::vector<glm::vec3> positions, normals;
  for (int i = 0; i < 400; ++i) {
    const float x = (float(i % 20) + .5f) / 20, y = (float(i / 20) + .5f) / 20;
    positions.push_back({-x, y, 0});
    normals.push_back({0, 0, 1});
    positions.push_back({0, y, -x});
    normals.push_back({1, 0, 0});
  }
  const Node node = nodeOf(positions, normals);
  const auto seenFrom = [&](const glm::vec3& v) {
    return node.position + middleOfSeen(node, glm::normalize(v), GatherSides::kFront);
  };
  EXPECT_LT(glm::length(seenFrom({0, 0, 1}) - glm::vec3(-.5f, .5f, 0)), .02f);
  EXPECT_LT(glm::length(seenFrom({1, 0, 0}) - glm::vec3(0, .5f, -.5f)), .02f);
  EXPECT_LT(glm::length(seenFrom({1, 0, 1}) - glm::vec3(-.25f, .5f, -.25f)), .02f);
}

// What a node looks like from `distance` of its position, over its projected area.
float perspectiveOf(const Node& node, const glm::vec3& v, float distance) {
  Contribution patch;
  EXPECT_TRUE(makeContribution(node, -distance * v, {}, patch));
  return patch.solid_angle * distance * distance / facingAreas(node, v).front;
}

TEST(RoughNode, IsAsLargeFromCloseByAsItLooks) {
  const std::vector<glm::vec3> all = evenDirections(2000);
  const Node sphere = nodeOf(all, all);
  // A disk seen from behind the same sphere, and its hollow
  std::vector<glm::vec3> bowl, bowl_normals;
  for (const glm::vec3& d : all) {
    if (d.z < 0) bowl.push_back(d), bowl_normals.push_back(-d);
  }
  const Node hollow = nodeOf(bowl, bowl_normals);
  for (const float distance : {8.f, 16.f, 100.f}) {
    const float ball = 2 * (distance * distance) * (1 - std::sqrt(1 - 1 / (distance * distance)));
    EXPECT_NEAR(perspectiveOf(sphere, {0, 0, 1}, distance), ball, .03f) << distance;
    // Through its rim, half a radius before its middle
    const float rim = distance / (distance - .5f);
    EXPECT_NEAR(perspectiveOf(hollow, {0, 0, 1}, distance), rim * rim, .03f) << distance;
  }
}

// A cap of a sphere: the area that faces away from it shows at its rim.
TEST(Facet, ThatCurvesShowsWhatOfItFacesTheReceiver) {
  constexpr float kCapCosine = .9f;
  std::vector<glm::vec3> cap;
  for (const glm::vec3& d : evenDirections(20000)) {
    if (d.z > kCapCosine) cap.push_back(d);
  }
  glm::vec3 mean(0);
  for (const glm::vec3& normal : cap) mean += normal / float(cap.size());
  Facet facet{};
  facet.normal = mean;
  facet.area = 1;
  for (float angle = 0; angle < 3; angle += .05f) {
    const glm::vec3 d(std::sin(angle), 0, std::cos(angle));
    float front = 0;
    for (const glm::vec3& normal : cap) front += std::max(0.f, glm::dot(normal, d));
    const FacingAreas facing = facingAreas(facet, d);
    EXPECT_NEAR(facing.front, front / float(cap.size()), .012f) << angle;
    EXPECT_NEAR(facing.front - facing.back, glm::dot(mean, d), 1e-5f);
  }
  // With one normal there is nothing between front and back
  facet.normal = {0, 0, 1};
  EXPECT_EQ(facingAreas(facet, glm::normalize(glm::vec3(1, 0, -.01f))).front, 0);
}

TEST(Facet, OfTwoSidedSurfelsShowsAndLightsBothSides) {
  Facet facet{};
  facet.normal = {0, 0, 1};
  facet.area = facet.radius = 1;
  facet.covariance = withoutDirection(facet.normal);
  facet.radiosity = {1, 2, 3};
  facet.is_two_sided = true;
  Contribution front, back, thicket;
  ASSERT_TRUE(makeContribution(facet, {0, 0, -10}, {}, front));
  ASSERT_TRUE(makeContribution(facet, {0, 0, 10}, {}, back));
  EXPECT_EQ(front.solid_angle, .01f);
  EXPECT_EQ(back.solid_angle, .01f);
  EXPECT_EQ(back.radiosity, facet.radiosity);
  EXPECT_EQ(back.thicket, 0);
  // Backs alone cover as much, and are dark
  ASSERT_TRUE(makeContribution(facet, {0, 0, 10}, {.sides = GatherSides::kBack}, back));
  EXPECT_EQ(back.solid_angle, .01f);
  EXPECT_EQ(back.radiosity, glm::vec3(0));
  // One of several stands apart from what is before and behind it
  facet.is_thicket = true;
  ASSERT_TRUE(makeContribution(facet, {0, 0, 10}, {}, thicket));
  EXPECT_EQ(thicket.thicket, 1);
  EXPECT_EQ(thicket.overlap, 1);
  EXPECT_LT(thicket.reach, .2f * front.reach);
}

TEST(RoughNode, TheMiddleOfWhatIsSeenStaysWithinTheRadius) {
  const std::vector<glm::vec3> all = evenDirections(200);
  Node node = nodeOf(all, all);
  for (glm::vec3& row : node.rough.front_moment) row *= 100.f;
  for (const glm::vec3& v : evenDirections(20)) {
    EXPECT_NEAR(glm::length(middleOfSeen(node, v, GatherSides::kFront)), node.radius, 1e-4f);
  }
}

TEST(RoughNode, ShowsNoMoreThanAPartOfItsOutline) {
  // 10 parallel unit squares behind each other: ten times what shows
  std::vector<glm::vec3> positions, normals;
  for (int i = 0; i < 4000; ++i) {
    positions.push_back({float(i % 20) / 20, float(i / 20 % 20) / 20, float(i / 400) / 10});
    normals.push_back(i % 3 == 0 ? glm::vec3(0, 0, -1) : glm::vec3(0, 0, 1));
  }
  Node node = nodeOf(positions, normals);
  node.area = 10;
  // The square has the covariance of an ellipse of 4 pi / 12
  EXPECT_NEAR(roughCover(node, {0, 0, 1}, 10, 0).area, kFidelity.filled_outline * kPi / 3, .01f);
  EXPECT_NEAR(roughCover(node, {0, 1, 0}, 10, 0).area, kFidelity.filled_outline * kPi / 3, .02f);
}

TEST(RoughNode, OfAWireShowsAllThatFacesTheReceiver) {
  // Eight sides of a wire of radius 1 / 200 along x; of its spread across a file keeps nothing
  std::vector<glm::vec3> positions, normals;
  for (int i = 0; i < 800; ++i) {
    const float angle = float(i % 8) * kPi / 4;
    normals.push_back({0, std::cos(angle), std::sin(angle)});
    positions.push_back(glm::vec3(float(i / 8) / 100, 0, 0) + .005f * normals.back());
  }
  Node node = nodeOf(positions, normals);
  node.area = 2 * kPi * .005f;
  node.covariance = {{1 / 12.f, 0, 0, 0, 0, 0}};
  EXPECT_GT(roughCover(node, {0, 0, 1}, node.area, 0).area, .01f);
}

// A ball of radius 1 that is full of leaves is as wide as the ball, and hides what is spread in
// that at random; half of it being surface, it is half way to what a surface covers.
TEST(RoughNode, OfAThicketCoversItsOutlineInPart) {
  Node node{};
  node.radius = 1;
  node.forgetBounds();
  node.area = 4 * kPi;
  node.covariance = {{.2f, .2f, .2f, 0, 0, 0}};
  const glm::vec3 direction = {0, 0, 1};
  for (const float shown : {.1f, 1.f, 10.f}) {
    const RoughCover leaves = roughCover(node, direction, shown, 1);
    EXPECT_NEAR(leaves.area, kPi, .02f);
    EXPECT_NEAR(leaves.opacity, 1 - std::exp(-shown / kPi), .01f);
    const RoughCover surface = roughCover(node, direction, shown, 0);
    EXPECT_NEAR(surface.area, std::min(shown, kFidelity.filled_outline * .8f * kPi), .03f);
    EXPECT_EQ(surface.opacity, 1);
    const RoughCover half = roughCover(node, direction, shown, .5f);
    EXPECT_NEAR(half.area, (leaves.area + surface.area) / 2, 1e-5f);
    EXPECT_NEAR(half.area * half.opacity, (leaves.area * leaves.opacity + surface.area) / 2, 1e-5f);
  }
}

TEST(SurfelContribution, IsItsProjectedArea) {
  Surfel surfel;
  surfel.position = {0, 0, 2};
  surfel.normal = glm::normalize(glm::vec3(0, 1, -1));
  surfel.radius = .2f;
  surfel.area = .1f;
  surfel.radiosity = {3, 2, 1};
  Contribution patch;
  ASSERT_TRUE(makeContribution(surfel, surfel.position, {}, patch));
  EXPECT_FLOAT_EQ(patch.solid_angle, .1f / 4 * std::sqrt(.5f));
  EXPECT_EQ(patch.radiosity, surfel.radiosity);

  // The back side: nothing, black, or the same when two-sided
  EXPECT_FALSE(makeContribution(surfel, -surfel.position, {}, patch));
  ASSERT_TRUE(makeContribution(surfel, -surfel.position, {GatherSides::kBoth, true}, patch));
  EXPECT_EQ(patch.radiosity, glm::vec3(0));
  surfel.flags = kSurfelTwoSided;
  ASSERT_TRUE(makeContribution(surfel, -surfel.position, {}, patch));
  EXPECT_EQ(patch.radiosity, surfel.radiosity);
}

// A two-sided surfel that has little of its disk is of hair or grass.
TEST(SurfelContribution, PiecesOfRibbonsAreThickets) {
  Surfel surfel;
  surfel.position = {0, 0, 2};
  surfel.normal = {0, 0, -1};
  surfel.radius = .2f;
  surfel.area = .1f * kPi * surfel.radius * surfel.radius;
  Contribution surface, ribbon, leaf;
  ASSERT_TRUE(makeContribution(surfel, surfel.position, {}, surface));
  EXPECT_EQ(surface.thicket, 0);
  surfel.flags = kSurfelTwoSided;
  ASSERT_TRUE(makeContribution(surfel, surfel.position, {}, ribbon));
  EXPECT_EQ(ribbon.thicket, 1);
  EXPECT_EQ(ribbon.overlap, 0);
  EXPECT_LT(ribbon.reach, .2f * surface.reach);
  surfel.area *= 2;
  ASSERT_TRUE(makeContribution(surfel, surfel.position, {}, leaf));
  EXPECT_EQ(leaf.thicket, 0);
  EXPECT_EQ(leaf.reach, surface.reach);
}

TEST(SurfelContribution, SphereLooksTheSameFromEverywhere) {
  Surfel surfel;
  surfel.radius = .2f;
  surfel.area = .1f;
  surfel.radiosity = {3, 2, 1};
  surfel.flags = kSurfelSphere;
  for (const glm::vec3& direction : evenDirections(20)) {
    Contribution patch;
    ASSERT_TRUE(makeContribution(surfel, 2.f * direction, {}, patch));
    EXPECT_NEAR(patch.solid_angle, .1f / 4, 1e-6);
    EXPECT_EQ(patch.radiosity, surfel.radiosity);
  }
}

TEST(SurfelContribution, NothingIsSeenOfASurfelAtTheReceiver) {
  Surfel surfel;
  surfel.radius = surfel.area = 1;
  surfel.normal = {0, 0, 1};
  surfel.flags = kSurfelTwoSided;
  Contribution patch;
  EXPECT_FALSE(makeContribution(surfel, glm::vec3(0), {GatherSides::kBoth, true}, patch));
}

}  // namespace
}  // namespace surfeit
