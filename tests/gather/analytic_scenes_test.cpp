#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/long_side.h"
#include "gather/brute_force.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/test_clouds.h"
#include "gather/test_scene.h"

namespace surfeit {
namespace {

using Cloud = std::vector<Surfel>;

// Disk area over surfel area, as a sampler would make it.
constexpr float kOverlap = 2;

Surfel makeSurfel(const glm::vec3& position, const glm::vec3& normal, float area,
                  const glm::vec3& radiosity = glm::vec3(1)) {
  Surfel surfel;
  surfel.position = position;
  surfel.normal = normal;
  surfel.area = area;
  surfel.radius = std::sqrt(kOverlap * area / kPi);
  surfel.radiosity = radiosity;
  return surfel;
}

// `count` surfels on a sphere, evenly; normals outward, or inward.
void addSphere(Cloud& cloud, int count, const glm::vec3& centre, float radius, bool inward,
               const glm::vec3& radiosity) {
  const float area = 4 * kPi * radius * radius / float(count);
  for (int i = 0; i < count; ++i) {
    const float z = 1 - float(2 * i + 1) / float(count), phi = float(i) * 2.39996323f;
    const float rho = std::sqrt(1 - z * z);
    const glm::vec3 outward(rho * std::cos(phi), rho * std::sin(phi), z);
    cloud.push_back(
        makeSurfel(centre + radius * outward, inward ? -outward : outward, area, radiosity));
  }
}

// A disk of `count` surfels with the normal down or up along z.
void addDisk(Cloud& cloud, int count, const glm::vec3& centre, float radius, float normal_z,
             const glm::vec3& radiosity) {
  const float area = kPi * radius * radius / float(count);
  for (int i = 0; i < count; ++i) {
    const float rho = radius * std::sqrt((float(i) + .5f) / float(count));
    const float phi = float(i) * 2.39996323f;
    cloud.push_back(makeSurfel(centre + glm::vec3(rho * std::cos(phi), rho * std::sin(phi), 0),
                               {0, 0, normal_z}, area, radiosity));
  }
}

// A parallelogram of side * side surfels from `corner` along two edges; normal edge_u x edge_v.
void addRectangle(Cloud& cloud, int side, const glm::vec3& corner, const glm::vec3& edge_u,
                  const glm::vec3& edge_v, const glm::vec3& radiosity) {
  const glm::vec3 cross = glm::cross(edge_u, edge_v);
  for (int i = 0; i < side * side; ++i) {
    const float u = (float(i % side) + .5f) / float(side),
                v = (float(i / side) + .5f) / float(side);
    cloud.push_back(makeSurfel(corner + u * edge_u + v * edge_v, glm::normalize(cross),
                               glm::length(cross) / float(side * side), radiosity));
  }
}

// Form factor of a polygon above the horizon: Lambert's formula, sum of edge angles dotted with the
// normal, over 2 pi.
double polygonFormFactor(std::span<const glm::vec3> corners, const LocalReceiver& receiver) {
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec3 a = glm::normalize(glm::dvec3(corners[i] - receiver.position));
    const glm::dvec3 b =
        glm::normalize(glm::dvec3(corners[(i + 1) % corners.size()] - receiver.position));
    const glm::dvec3 cross = glm::cross(a, b);
    sum += std::atan2(glm::length(cross), glm::dot(a, b)) * glm::normalize(cross);
  }
  return std::abs(glm::dot(sum, glm::dvec3(receiver.normal))) / (2 * double(kPi));
}

GatherQuality qualityOf(float max_solid_angle) {
  GatherQuality quality;
  quality.max_solid_angle = max_solid_angle;
  return quality;
}

constexpr float kSolidAngles[] = {0, .01f, .05f, .2f};

// What the cut may add to an error: large nodes drawn as rectangles leave gaps and overlap.
double cutError(float max_solid_angle) { return .35 * double(max_solid_angle); }

GatherResult bruteForce(const Cloud& cloud, const LocalReceiver& receiver,
                        GatherMode mode = GatherMode::kBleeding) {
  return gatherBruteForce(receiver, cloud, {mode, {}});
}

TEST(Gather, InsideUniformShellIrradianceEqualsRadiosity) {
  const glm::vec3 radiosity(4, 2, 1);
  Cloud cloud;
  addSphere(cloud, 60000, {1, 2, 3}, 2, true, radiosity);
  TestScene scene(cloud);
  for (const float max_solid_angle : kSolidAngles) {
    for (const LocalReceiver& receiver :
         {LocalReceiver{{1, 2, 3}, {0, 0, 1}}, LocalReceiver{{1.8f, 1.5f, 3.7f}, {1, 0, 0}},
          LocalReceiver{{1, 2, 1.5f}, glm::normalize(glm::vec3(1, -2, -1))},
          LocalReceiver{{.5f, 2.5f, 3}, {0, 0, 0}}}) {
      const GatherResult result = scene.gather(receiver, qualityOf(max_solid_angle));
      EXPECT_NEAR(result.occlusion, 1, .02 + cutError(max_solid_angle)) << max_solid_angle;
      EXPECT_LE(result.occlusion, 1);
      EXPECT_NEAR(result.irradiance.x, 4 * result.occlusion, 1e-3);
      EXPECT_NEAR(result.irradiance.y, 2 * result.occlusion, 1e-3);
      EXPECT_NEAR(result.irradiance.z, 1 * result.occlusion, 1e-3);
    }
  }
}

TEST(Gather, OnTheShellItselfIrradianceEqualsRadiosity) {
  Cloud cloud;
  addSphere(cloud, 60000, {0, 0, 0}, 2, true, glm::vec3(1));
  TestScene scene(cloud);
  for (const std::size_t i : {100u, 20000u, 41000u}) {
    for (const float max_solid_angle : kSolidAngles) {
      const LocalReceiver receiver{cloud[i].position, cloud[i].normal};
      EXPECT_NEAR(scene.gather(receiver, qualityOf(max_solid_angle)).irradiance.x, 1,
                  .02 + cutError(max_solid_angle))
          << max_solid_angle;
    }
  }
}

TEST(Gather, DiskAboveHasItsFormFactor) {
  for (const float height : {.3f, 1.f, 3.f}) {
    Cloud cloud;
    addDisk(cloud, 20000, {0, 0, height}, 1, -1, {2, 2, 2});
    TestScene scene(cloud);
    const float expected = 1 / (1 + height * height);
    for (const float max_solid_angle : kSolidAngles) {
      const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 1}}, qualityOf(max_solid_angle));
      const double tolerance = .01 + cutError(max_solid_angle) / 3;
      EXPECT_NEAR(result.occlusion, expected, tolerance) << height << " " << max_solid_angle;
      EXPECT_NEAR(result.irradiance.x, 2 * expected, 2 * tolerance);
    }
  }
}

TEST(Gather, SphereHasItsFormFactor) {
  for (const float angle : {0.f, .5f, 1.f}) {  // from the receiver's normal
    const float distance = 2, radius = .7f;
    const glm::vec3 centre = distance * glm::vec3(std::sin(angle), 0, std::cos(angle));
    Cloud cloud;
    addSphere(cloud, 40000, centre, radius, false, {2, 2, 2});
    TestScene scene(cloud);
    const float expected = radius * radius / (distance * distance) * std::cos(angle);
    for (const float max_solid_angle : kSolidAngles) {
      const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 1}}, qualityOf(max_solid_angle));
      EXPECT_NEAR(result.occlusion, expected, .012) << angle << " " << max_solid_angle;
      EXPECT_NEAR(result.irradiance.x, 2 * expected, .024);
    }
  }
}

TEST(Gather, PerpendicularRectangleHasItsFormFactor) {
  const glm::vec3 corner{.2f, -1, 0}, edge_u{0, 2, 0}, edge_v{0, 0, 1.5f};
  Cloud cloud;
  addRectangle(cloud, 150, corner, edge_v, edge_u, {1, 1, 1});
  ASSERT_LT(cloud[0].normal.x, 0);
  TestScene scene(cloud);
  const glm::vec3 corners[] = {corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v};
  for (const glm::vec3& position :
       {glm::vec3(0), glm::vec3(-.5f, .3f, 0), glm::vec3(.15f, .9f, 0)}) {
    const LocalReceiver receiver{position, {0, 0, 1}};
    const double expected = polygonFormFactor(corners, receiver);
    for (const float max_solid_angle : kSolidAngles) {
      EXPECT_NEAR(scene.gather(receiver, qualityOf(max_solid_angle)).occlusion, expected, .018)
          << position.x << " " << max_solid_angle;
    }
  }
}

TEST(Gather, CornerOfTwoWallsApproachesHalf) {
  // A floor receiver at the foot of a wall that goes far: the wall fills half of its hemisphere
  Cloud cloud;
  addRectangle(cloud, 300, {0, -30, 0}, {0, 0, 30}, {0, 60, 0}, {1, 1, 1});
  TestScene scene(cloud);
  const LocalReceiver receiver{{-.4f, 0, 0}, {0, 0, 1}};
  EXPECT_NEAR(scene.gather(receiver, qualityOf(.05f)).occlusion, .5, .03);
}

TEST(Gather, FlatPlaneDoesNotOccludeItself) {
  for (const glm::vec3& normal : {glm::vec3(0, 0, 1), glm::normalize(glm::vec3(1, -2, 3))}) {
    const glm::vec3 u = glm::normalize(glm::cross(normal, glm::vec3(1, 0, 0)));
    Cloud cloud;
    addRectangle(cloud, 120, {5, 6, 7}, u, glm::cross(normal, u), {1, 1, 1});
    TestScene scene(cloud);
    for (const float max_solid_angle : kSolidAngles) {
      const Surfel& own = cloud[120 * 60 + 60];
      const GatherResult result =
          scene.gather({own.position, own.normal}, qualityOf(max_solid_angle));
      EXPECT_LT(result.occlusion, 1e-3) << max_solid_angle;
    }
  }
}

TEST(Gather, NothingAboveTheHorizonGathersNothing) {
  Cloud cloud;
  addSphere(cloud, 1000, {0, 0, -3}, 1, false, {1, 1, 1});
  TestScene scene(cloud);
  const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 1}}, qualityOf(.05f));
  EXPECT_EQ(result.occlusion, 0);
  EXPECT_EQ(result.irradiance, glm::vec3(0));
  EXPECT_EQ(scene.work().nodes_visited, 1u);
}

TEST(Gather, BackSidesCoverOnlyWhenAsked) {
  Cloud cloud;
  addDisk(cloud, 5000, {0, 0, 1}, 1, +1, {2, 2, 2});  // seen from behind
  TestScene scene(cloud);
  const LocalReceiver receiver{{0, 0, 0}, {0, 0, 1}};
  for (const float max_solid_angle : kSolidAngles) {
    GatherQuality quality = qualityOf(max_solid_angle);
    EXPECT_EQ(scene.gather(receiver, quality).occlusion, 0);
    quality.sides = GatherSides::kBoth;
    const GatherResult both = scene.gather(receiver, quality);
    EXPECT_NEAR(both.occlusion, .5, .015);
    EXPECT_EQ(both.irradiance, glm::vec3(0));
  }
}

TEST(Gather, TwoSidedSurfelsCoverAndSendFromBehind) {
  Cloud cloud;
  addDisk(cloud, 5000, {0, 0, 1}, 1, +1, {2, 2, 2});
  for (Surfel& surfel : cloud) surfel.flags = kSurfelTwoSided;
  const GatherResult result = bruteForce(cloud, {{0, 0, 0}, {0, 0, 1}});
  EXPECT_NEAR(result.occlusion, .5, .015);
  EXPECT_NEAR(result.irradiance.x, 1, .03);
}

// Long and narrow, near and far, and turned in every way.
TEST(Gather, PieceOfARibbonHasItsFormFactor) {
  for (const float distance : {.3f, 1.f, 3.f, 12.f}) {
    for (const float turn : {0.f, .3f, .7f, 1.2f}) {
      Surfel ribbon = makeSurfel({0, 0, distance}, {0, 0, 1}, .8f * .1f);
      ribbon.radius = .5f * std::hypot(.8f, .1f);
      ribbon.flags = kSurfelTwoSided;
      setLongSide(.8f * glm::vec3(std::cos(turn), std::sin(turn), 0), ribbon);
      TestScene scene({ribbon});
      const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 1}}, GatherQuality{.bias = 0});
      // Integral of cos^2 / (pi d^2), at the middles of small squares
      double expected = 0;
      for (int i = 0; i < 400; ++i) {
        for (int k = 0; k < 50; ++k) {
          const double x = .8 * ((i + .5) / 400 - .5), y = .1 * ((k + .5) / 50 - .5);
          const double d = double(distance), d_sq = x * x + y * y + d * d;
          expected += .08 / 20'000 * d * d / (double(kPi) * d_sq * d_sq);
        }
      }
      EXPECT_NEAR(double(result.occlusion), expected, .04 * expected) << distance << ' ' << turn;
    }
  }
}

TEST(Gather, SphereSurfelHasItsFormFactor) {
  Surfel surfel;
  surfel.radius = 1;
  surfel.area = kPi;
  surfel.flags = kSurfelSphere;
  surfel.radiosity = {2, 2, 2};
  GatherQuality quality;
  quality.raster_resolution = 32;
  quality.bias = 0;
  for (const float distance : {2.f, 10.f}) {  // near and mid field
    surfel.position = {0, 0, distance};
    const GatherResult result =
        gatherBruteForce({{0, 0, 0}, {0, 0, 1}}, {&surfel, 1}, {GatherMode::kBleeding, quality});
    EXPECT_NEAR(result.occlusion * distance * distance, 1, .03);
    EXPECT_NEAR(result.irradiance.x * distance * distance, 2, .06);
  }
}

TEST(Gather, ReceiverInsideASphereSurfelIsNotCoveredByIt) {
  Surfel surfel;
  surfel.radius = 1;
  surfel.area = kPi;
  surfel.flags = kSurfelSphere;
  EXPECT_EQ(bruteForce({surfel}, {{0, 0, 0}, {0, 0, 1}}).occlusion, 0);
  EXPECT_EQ(bruteForce({surfel}, {{.3f, 0, 0}, {0, 0, 0}}).occlusion, 0);
}

TEST(Gather, SphericalReceiverSeesSolidAngleOverFourPi) {
  Cloud cloud;
  addDisk(cloud, 20000, {0, 0, 1}, 1, -1, {2, 2, 2});
  TestScene scene(cloud);
  const float expected = .5f * (1 - 1 / std::sqrt(2.f));
  const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 0}}, qualityOf(.05f));
  EXPECT_NEAR(result.occlusion, expected, .005);
  EXPECT_NEAR(result.irradiance.x, 2 * expected, .01);
}

TEST(Gather, NearSurfaceHidesTheOneBehind) {
  Cloud cloud;
  addDisk(cloud, 20000, {0, 0, 1}, 3, -1, {1, 0, 0});
  addDisk(cloud, 20000, {0, 0, 2}, 3, -1, {0, 1, 0});
  TestScene scene(cloud);
  for (const float max_solid_angle : kSolidAngles) {
    const GatherResult result = scene.gather({{0, 0, 0}, {0, 0, 1}}, qualityOf(max_solid_angle));
    const double tolerance = .01 + cutError(max_solid_angle) / 3;
    EXPECT_NEAR(result.irradiance.x, .9, tolerance) << max_solid_angle;
    EXPECT_NEAR(result.irradiance.y, 0, tolerance) << max_solid_angle;
  }
}

TEST(Gather, SurfelsBeyondMaxDistanceDoNotCount) {
  Cloud cloud;
  addDisk(cloud, 5000, {0, 0, 1}, .5f, -1, {1, 1, 1});
  TestScene scene(cloud);
  const LocalReceiver receiver{{0, 0, 0}, {0, 0, 1}};
  GatherQuality quality = qualityOf(.05f);
  quality.max_distance = 1.2f;
  EXPECT_NEAR(scene.gather(receiver, quality).occlusion, .2, .015);
  quality.max_distance = .9f;
  EXPECT_EQ(scene.gather(receiver, quality).occlusion, 0);
}

// A cloud with everything: surfaces, things in front of each other, equal positions.
Cloud cloudOfEverything() {
  Cloud cloud;
  addRectangle(cloud, 100, {-3, -3, 0}, {6, 0, 0}, {0, 6, 0}, {.8f, .7f, .6f});
  addSphere(cloud, 5000, {0, 0, .8f}, .7f, false, {1, .2f, .1f});
  addSphere(cloud, 3000, {1.5f, .5f, 1.5f}, .5f, false, {.1f, .2f, 1});
  addSphere(cloud, 2000, {0, 0, 0}, 6, true, {.5f, .5f, .5f});
  for (std::size_t i = 0; i < 40; ++i) {
    Surfel twin = cloud[300 * i];
    twin.normal = -twin.normal;
    twin.radiosity = {float(i), 1, 2};
    cloud.push_back(twin);
  }
  return cloud;
}

std::vector<LocalReceiver> receiversOn(const Cloud& cloud, std::size_t step) {
  std::vector<LocalReceiver> receivers;
  for (std::size_t i = step / 2; i < cloud.size(); i += step) {
    receivers.push_back({cloud[i].position, cloud[i].normal});
  }
  receivers.push_back({{.1f, .2f, 3}, {0, 0, 0}});
  return receivers;
}

void expectEqual(const GatherResult& a, const GatherResult& b) {
  EXPECT_EQ(a.occlusion, b.occlusion);
  EXPECT_EQ(a.irradiance, b.irradiance);
}

// Equal distances are drawn in the order of the walk: the last fill what is left of a pixel.
void expectAlike(const GatherResult& a, const GatherResult& b) {
  EXPECT_NEAR(a.occlusion, b.occlusion, 1e-3);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.irradiance[i], b.irradiance[i], 4e-3);
}

TEST(Gather, ZeroMaxSolidAngleEqualsBruteForce) {
  const Cloud cloud = cloudOfEverything();
  TestScene scene(cloud);
  for (const GatherMode mode : {GatherMode::kBleeding, GatherMode::kOcclusion}) {
    for (const LocalReceiver& receiver : receiversOn(cloud, 1500)) {
      expectAlike(scene.gather(receiver, qualityOf(0), mode),
                  bruteForce(scene.cloud(), receiver, mode));
    }
  }
}

TEST(Gather, OrderOfSurfelsHardlyChangesTheResult) {
  const Cloud cloud = cloudOfEverything();
  Cloud shuffled = cloud;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(1));
  for (const LocalReceiver& receiver : receiversOn(cloud, 3000)) {
    expectAlike(bruteForce(cloud, receiver), bruteForce(shuffled, receiver));
  }
}

TEST(Gather, CutApproachesBruteForce) {
  const Cloud cloud = cloudOfEverything();
  TestScene scene(cloud);
  double before = 1;
  for (const float max_solid_angle : {.2f, .05f, .0125f}) {
    double error = 0;
    const std::vector<LocalReceiver> receivers = receiversOn(cloud, 400);
    for (const LocalReceiver& receiver : receivers) {
      const double difference =
          double(scene.gather(receiver, qualityOf(max_solid_angle)).occlusion -
                 bruteForce(cloud, receiver).occlusion);
      error += difference * difference / double(receivers.size());
    }
    EXPECT_LT(std::sqrt(error), std::max(1.1 * before, .0006)) << max_solid_angle;
    before = std::sqrt(error);
  }
  EXPECT_LT(before, .001);
}

TEST(Gather, OcclusionIsTheSameInBothModes) {
  const Cloud cloud = cloudOfEverything();
  TestScene scene(cloud);
  for (const LocalReceiver& receiver : receiversOn(cloud, 1500)) {
    EXPECT_EQ(scene.gather(receiver, qualityOf(.05f), GatherMode::kBleeding).occlusion,
              scene.gather(receiver, qualityOf(.05f), GatherMode::kOcclusion).occlusion);
  }
}

TEST(Gather, EarlierReceiversDoNotChangeTheResult) {
  const Cloud cloud = cloudOfEverything();
  TestScene scene(cloud);
  PacketGatherer gatherer(GatherMode::kBleeding, qualityOf(.05f));
  for (const LocalReceiver& receiver : receiversOn(cloud, 1500)) {
    GatherResult result;
    ASSERT_TRUE(gatherer.gather({&receiver, 1}, scene.reader(), {&result, 1}).ok());
    expectEqual(result, scene.gather(receiver, qualityOf(.05f)));
  }
}

TEST(Gather, EveryResolutionGivesFiniteResultsWithinBounds) {
  const Cloud cloud = cloudOfEverything();
  TestScene scene(cloud);
  for (int resolution = 2; resolution <= 64; resolution += 2) {
    GatherQuality quality = qualityOf(.3f);
    quality.raster_resolution = resolution;
    for (const LocalReceiver& receiver : receiversOn(cloud, 5000)) {
      const GatherResult result = scene.gather(receiver, quality);
      EXPECT_GE(result.occlusion, 0);
      EXPECT_LE(result.occlusion, 1);
      EXPECT_TRUE(std::isfinite(result.irradiance.x + result.irradiance.y + result.irradiance.z));
    }
  }
}

TEST(Gather, HugeAndTinyScalesGiveTheSameResult) {
  Cloud cloud;
  addDisk(cloud, 2000, {0, 0, 1}, 1, -1, {1, 1, 1});
  const float expected = bruteForce(cloud, {{0, 0, 0}, {0, 0, 1}}).occlusion;
  for (const float scale : {1e-6f, 1e6f}) {
    Cloud scaled = cloud;
    for (Surfel& surfel : scaled) {
      surfel.position *= scale;
      surfel.radius *= scale;
      surfel.area *= scale * scale;
    }
    EXPECT_NEAR(bruteForce(scaled, {{0, 0, 0}, {0, 0, 1}}).occlusion, expected, 1e-4);
  }
}

TEST(Gather, SpheresOfTheReceiversOwnSurfaceDoNotCount) {
  Surfel sphere;
  sphere.flags = kSurfelSphere;
  sphere.radius = 0.1f;
  sphere.area = 0.0314f;
  // A sphere that touches it does not count for a receiver that is one itself
  sphere.position = {0, 0, 0.19f};
  EXPECT_EQ(bruteForce({sphere}, {{0, 0, 0}, {0, 0, 0}}).occlusion, 0);
  EXPECT_GT(bruteForce({sphere}, {{0, 0, 0}, {0, 0, 1}}).occlusion, 0);
  // Beyond, it covers the share of the whole sphere that its cap has
  sphere.position = {0, 0, 0.21f};
  const double cosine = std::sqrt(1 - std::pow(0.1 / 0.21, 2));
  EXPECT_NEAR(bruteForce({sphere}, {{0, 0, 0}, {0, 0, 0}}).occlusion, (1 - cosine) / 2, 0.01);
}

}  // namespace
}  // namespace surfeit
