#include "gather/rules/contribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "gather/cut/cut.h"
#include "gather/packet/packet_raster.h"
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

// What a receiver in unit direction `to_receiver` from a rough node sees of it.
RoughSight seenFrom(const Node& node, const glm::vec3& to_receiver) {
  RoughSight sight;
  fastestPacketKernel().seeRoughNode(node, -to_receiver, sight);
  return sight;
}
FacingAreas facingAreasOf(const Node& node, const glm::vec3& to_receiver) {
  return seenFrom(node, to_receiver).facing;
}
// A rough node of two colors: what faces along z is red, the other way green.
TEST(RoughNode, SendsTheLightOfWhatFacesTheReceiver) {
  const std::vector<glm::vec3> normals = evenDirections(1000);
  std::vector<glm::vec3> reds, greens;
  for (const glm::vec3& normal : normals) (normal.z > 0 ? reds : greens).push_back(normal);
  Node node = makeNode(normals, {.5f, .5f, 0});
  const ShCoefficients red = projectLobes(reds, kClampedCosine);
  const ShCoefficients green = projectLobes(greens, kClampedCosine);
  for (std::size_t i = 0; i < kShCount; ++i) {
    node.rough.sh[i][powerKind(0)] = red[i] / 1000;
    node.rough.sh[i][powerKind(1)] = green[i] / 1000;
  }
  const glm::vec3 above = seenFrom(node, {0, 0, 1}).radiosity;
  EXPECT_LT(glm::length(above - glm::vec3(1, 0, 0)), .07f);
  const glm::vec3 beside = seenFrom(node, {1, 0, 0}).radiosity;
  EXPECT_NEAR(beside.r, beside.g, .02);
  EXPECT_NEAR(beside.r + beside.g, 1, .1);
}

// Of one normal, and of spheres, every band is exact.
TEST(RoughNode, SendsItsOwnLightWhenItHasOne) {
  for (const glm::vec3& normal : evenDirections(50)) {
    const Node node = makeNode(std::span(&normal, 1), {3, 2, 1});
    for (const glm::vec3& direction : evenDirections(60)) {
      const glm::vec3 seen = seenFrom(node, direction).radiosity;
      EXPECT_NEAR(seen.r, 3, 1e-3);
      EXPECT_NEAR(seen.b, 1, 1e-3);
    }
  }
}

FacingAreas facingOf(std::span<const glm::vec3> normals, const glm::vec3& to_receiver) {
  return facingAreasOf(makeNode(normals, {1, 1, 1}), to_receiver);
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
    EXPECT_NEAR(facingAreasOf(sphere, d).front, 2, .01);
    EXPECT_NEAR(facingAreasOf(sphere, d).back, 2, .01);
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

// The solid angle that a receiver at the origin sees of what is added to its raster, and the light.
struct Seen {
  double solid_angle = 0;
  glm::vec3 radiosity{0};  // mean of what covers
};
template <typename Add>
Seen seenOf(const Add& add, GatherSides sides = GatherSides::kFront) {
  GatherQuality quality;
  quality.raster_resolution = 64;
  quality.sides = sides;
  quality.near_field_radii = 0;
  const GatherRules rules(GatherMode::kBleeding, quality);
  const LocalReceiver receiver;  // without a normal, all directions weigh alike
  PacketRaster raster(rules);
  raster.begin({&receiver, 1}, viewPacket({&receiver, 1}, rules));
  add(raster);
  raster.sort();
  raster.draw();
  GatherResult result;
  raster.integrate({&result, 1});
  const float covered = result.occlusion;
  return {4 * double(kPi) * double(covered),
          covered > 0 ? result.irradiance / covered : glm::vec3(0)};
}
// At `place`, as seen from the origin.
Seen seenOf(Node node, const glm::vec3& place, GatherSides sides = GatherSides::kFront) {
  node.position = place;
  return seenOf([&](PacketRaster& raster) { raster.addNode(node); }, sides);
}
Seen seenOf(const Surfel& surfel, GatherSides sides = GatherSides::kFront) {
  return seenOf([&](PacketRaster& raster) { raster.addSurfels({&surfel, 1}); }, sides);
}

TEST(NodeContribution, FlatNodeIsADisk) {
  const glm::vec3 normal{0, 0, -1};
  Node node = makeNode(std::span(&normal, 1), {3, 2, 1});
  node.flags = kNodeFlat;
  node.rough.sh = {};
  node.covariance = (1 / 8.f) * withoutDirection(normal);
  const Seen front = seenOf(node, {0, 0, 4});
  EXPECT_NEAR(front.solid_angle, 1 / 16., .002);
  EXPECT_NEAR(front.radiosity.x, 3, 1e-3);

  // From behind: nothing, or black
  EXPECT_EQ(seenOf(node, {0, 0, -4}).solid_angle, 0);
  const Seen both = seenOf(node, {0, 0, -4}, GatherSides::kBoth);
  EXPECT_NEAR(both.solid_angle, 1 / 16., .002);
  EXPECT_EQ(both.radiosity, glm::vec3(0));
}

TEST(NodeContribution, RoughNodeShowsAQuarterOfItsAreaOnAverage) {
  const Node node = makeNode(evenDirections(500), {3, 2, 1});
  const Seen fronts = seenOf(node, {0, 0, 4});
  EXPECT_NEAR(fronts.solid_angle, 1. / 64, 1e-3);
  EXPECT_NEAR(fronts.radiosity.x, 3, .02);
  const Seen both = seenOf(node, {0, 0, 4}, GatherSides::kBoth);
  EXPECT_NEAR(both.solid_angle, 2. / 64, 2e-3);
  EXPECT_NEAR(both.radiosity.x, 1.5, .02);  // half of what covers is black
}

TEST(NodeContribution, NeverExceedsTheOutlineOfItsSphere) {
  Node node = makeNode(evenDirections(500), {1, 1, 1});
  node.radius = .1f;
  node.forgetBounds();
  node.covariance = .01f * node.covariance;
  const Seen seen = seenOf(node, {0, 0, 2});
  EXPECT_NEAR(seen.solid_angle, double(kPi) * .01 / 4, 1e-4);
  EXPECT_NEAR(seen.radiosity.x, 1, .01);
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
  return seenPart(node, -100.f * v, facingAreasOf(node, v), sides).middle;
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
  const FacingAreas facing = facingAreasOf(node, v);
  const SeenPart seen = seenPart(node, -distance * v, facing, GatherSides::kFront);
  const float middle = glm::length(seen.middle - distance * v);
  const float area = roughCover(node, -v, seen.perspective * facing.front, 0).area;
  return area * distance * distance / (middle * middle * facing.front);
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
  Node node{};
  node.radius = 1;
  node.forgetBounds();
  node.flatness = glm::length(mean);
  node.normal = glm::normalize(mean);
  node.flags = kNodeFlat;
  node.area = 1;
  node.covariance = (1 / 6.f) * withoutDirection(glm::vec3(0));
  node.radiosity = {1, 1, 1};
  constexpr float kDistance = 12;
  for (float angle = 0; angle < 3; angle += .1f) {
    const glm::vec3 d(std::sin(angle), 0, std::cos(angle));
    float front = 0;
    for (const glm::vec3& normal : cap) {
      front += std::max(0.f, glm::dot(normal, d)) / float(cap.size());
    }
    const Seen seen = seenOf(node, -kDistance * d);
    EXPECT_NEAR(seen.solid_angle * double(kDistance * kDistance), double(front), .03) << angle;
  }
  // With one normal there is nothing between front and back
  node.flatness = 1;
  EXPECT_EQ(seenOf(node, -kDistance * glm::normalize(glm::vec3(1, 0, -.01f))).solid_angle, 0);
}

TEST(Facet, OfTwoSidedSurfelsShowsAndLightsBothSides) {
  Node node{};
  node.radius = node.area = node.flatness = 1;
  node.forgetBounds();
  node.normal = {0, 0, 1};
  node.flags = kNodeFlat | kNodeTwoSided;
  node.covariance = (1 / 8.f) * withoutDirection(node.normal);
  node.radiosity = {1, 2, 3};
  for (const float place : {-10.f, 10.f}) {
    const Seen seen = seenOf(node, {0, 0, place});
    EXPECT_NEAR(seen.solid_angle, .01, 1e-3);
    EXPECT_NEAR(seen.radiosity.z, 3, 1e-3);
    // Backs alone cover as much, and are dark
    const Seen back = seenOf(node, {0, 0, place}, GatherSides::kBack);
    EXPECT_NEAR(back.solid_angle, .01, 1e-3);
    EXPECT_EQ(back.radiosity, glm::vec3(0));
  }
}

TEST(RoughNode, TheMiddleOfWhatIsSeenStaysWithinTheRadius) {
  const std::vector<glm::vec3> all = evenDirections(200);
  Node node = nodeOf(all, all);
  for (glm::vec3& row : node.rough.front_moment) row *= 100.f;
  for (const glm::vec3& v : evenDirections(20)) {
    EXPECT_NEAR(glm::length(middleOfSeen(node, v, GatherSides::kFront)), node.radius, 1e-4f);
  }
}

TEST(RoughNode, ShowsNoMoreThanItsOutline) {
  // 10 parallel unit squares behind each other: ten times what shows
  std::vector<glm::vec3> positions, normals;
  for (int i = 0; i < 4000; ++i) {
    positions.push_back({float(i % 20) / 20, float(i / 20 % 20) / 20, float(i / 400) / 10});
    normals.push_back(i % 3 == 0 ? glm::vec3(0, 0, -1) : glm::vec3(0, 0, 1));
  }
  Node node = nodeOf(positions, normals);
  node.area = 10;
  // The square has the covariance of an ellipse of 4 pi / 12
  EXPECT_NEAR(roughCover(node, {0, 0, 1}, 10).area, kPi / 3, .01f);
  EXPECT_NEAR(roughCover(node, {0, 1, 0}, 10).area, kPi / 3, .02f);
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

TEST(SurfelContribution, IsItsProjectedArea) {
  Surfel surfel;
  surfel.position = {0, 0, 2};
  surfel.normal = glm::normalize(glm::vec3(0, 1, -1));
  surfel.radius = .2f;
  surfel.area = .1f;
  surfel.radiosity = {3, 2, 1};
  const double expected = .1 / 4 * std::sqrt(.5);
  EXPECT_NEAR(seenOf(surfel).solid_angle, expected, .02 * expected);
  EXPECT_NEAR(seenOf(surfel).radiosity.x, 3, 1e-3);

  // The back side: nothing, black, or the same when two-sided
  surfel.position = {0, 0, -2};
  EXPECT_EQ(seenOf(surfel).solid_angle, 0);
  EXPECT_GT(seenOf(surfel, GatherSides::kBoth).solid_angle, 0);
  EXPECT_EQ(seenOf(surfel, GatherSides::kBoth).radiosity, glm::vec3(0));
  surfel.flags = kSurfelTwoSided;
  EXPECT_NEAR(seenOf(surfel).radiosity.x, 3, 1e-3);
}

TEST(SurfelContribution, SphereLooksTheSameFromEverywhere) {
  Surfel surfel;
  surfel.radius = .2f;
  surfel.area = .1f;
  surfel.radiosity = {3, 2, 1};
  surfel.flags = kSurfelSphere;
  for (const glm::vec3& direction : evenDirections(20)) {
    surfel.position = 2.f * direction;
    EXPECT_NEAR(seenOf(surfel).solid_angle, .1 / 4, .1 * .1 / 4);
    EXPECT_NEAR(seenOf(surfel).radiosity.x, 3, 1e-3);
  }
}

TEST(SurfelContribution, ASurfelAtTheReceiverLeavesNumbers) {
  Surfel surfel;
  surfel.radius = surfel.area = 1;
  surfel.normal = {0, 0, 1};
  surfel.flags = kSurfelTwoSided;
  EXPECT_TRUE(std::isfinite(seenOf(surfel, GatherSides::kBoth).solid_angle));
}

}  // namespace
}  // namespace surfeit
