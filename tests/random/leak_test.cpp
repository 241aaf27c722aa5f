// What hides, hides: light behind closed things does not arrive, at any quality.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

double meanLight(std::span<const Surfel> cloud, std::span<const LocalReceiver> receivers,
                 const GatherQuality& quality) {
  const auto scene = IndexedScene::make(cloud);
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  const auto results = (*scene)->gatherTogether(receivers, {GatherMode::kBleeding, quality});
  EXPECT_TRUE(results.ok()) << results.status().message();
  double sum = 0;
  for (const GatherResult& result : *results) sum += double(result.irradiance.x);
  return sum / double(receivers.size());
}

constexpr QualityPreset kPresets[] = {QualityPreset::kDraft, QualityPreset::kStandard,
                                      QualityPreset::kFinal};

struct LeakCase {
  std::string name;
  std::function<void(std::vector<Surfel>&, int)> add;  // so many surfels
};

class Leak : public ::testing::TestWithParam<LeakCase> {};

TEST_P(Leak, LightBehindClosedThingsDoesNotArrive) {
  const std::vector<LocalReceiver> receivers = receiversBehind();
  const std::vector<Surfel> lamp = hiddenLamp();
  for (const int count : {5000, 50'000}) {
    std::vector<Surfel> hidden = lamp;
    GetParam().add(hidden, count);
    for (const QualityPreset preset : kPresets) {
      GatherQuality quality;
      setQuality(preset, quality);
      const double open = meanLight(lamp, receivers, quality);
      ASSERT_GT(open, 0);
      const double leak = meanLight(hidden, receivers, quality) / open;
      EXPECT_LT(leak, .003) << count << ' ' << int(preset);
    }
  }
}

void seeBothSides(std::span<Surfel> surfels) {
  for (Surfel& surfel : surfels) surfel.flags |= kSurfelTwoSided;
}

INSTANTIATE_TEST_SUITE_P(
    ClosedThings, Leak,
    ::testing::Values(
        LeakCase{"Ball", [](auto& cloud, int count) { addBall(cloud, count, glm::vec3(0), 1); }},
        LeakCase{"Box", [](auto& cloud, int count) { addBox(cloud, count, glm::vec3(0), 1.6f); }},
        LeakCase{"Wall",
                 [](auto& cloud, int count) {
                   addSheet(cloud, count, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
                 }},
        LeakCase{"TwoSidedBall",
                 [](auto& cloud, int count) {
                   const std::size_t first = cloud.size();
                   addBall(cloud, count, glm::vec3(0), 1);
                   seeBothSides(std::span(cloud).subspan(first));
                 }},
        LeakCase{"TwoSidedWall",
                 [](auto& cloud, int count) {
                   const std::size_t first = cloud.size();
                   addSheet(cloud, count, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
                   seeBothSides(std::span(cloud).subspan(first));
                 }},
        LeakCase{"TwoSidedSlantedWall",
                 [](auto& cloud, int count) {
                   const std::size_t first = cloud.size();
                   addSheet(cloud, count, {-1.3f, -1, -1}, {2.6f, 0.3f, 2}, {0.2f, 2, 0});
                   seeBothSides(std::span(cloud).subspan(first));
                 }}),
    [](const auto& leak) { return leak.param.name; });

// In a sphere of radius 1.
std::vector<LocalReceiver> receiversWithin() {
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 32; ++i) {
    const float angle = 2.4f * float(i), height = 1 - (2 * float(i) + 1) / 32;
    const float across = std::sqrt(1 - height * height);
    const glm::vec3 to(across * std::cos(angle), across * std::sin(angle), height);
    receivers.push_back({.8f * float(i) / 32 * to, glm::vec3(to.y, to.z, to.x)});
  }
  return receivers;
}

// Within its sphere nothing is open, however large the surfels are beside the pixels.
TEST(ClosedShell, IsClosedAtAnyNumberOfPixels) {
  const std::vector<LocalReceiver> receivers = receiversWithin();
  for (const int count : {2000, 20'000}) {
    std::vector<Surfel> shell;
    addBall(shell, count, glm::vec3(0), 1, 1, -1, 0);
    const auto scene = IndexedScene::make(shell);
    ASSERT_TRUE(scene.ok());
    for (const int pixels : {8, 16, 24, 32, 48, 64}) {
      GatherQuality quality;
      quality.raster_resolution = pixels;
      const auto results = (*scene)->gatherTogether(receivers, {GatherMode::kOcclusion, quality});
      ASSERT_TRUE(results.ok());
      double mean = 0;
      for (const GatherResult& result : *results) mean += double(result.occlusion) / 32;
      EXPECT_GT(mean, .995) << count << ' ' << pixels;
    }
  }
}

// Points without normals are spheres: those of a shell close it, and so do nodes of them, which are
// rough. (Nodes without reach hid each other where they overlap, and covered .93 with .02 sr.)
TEST(ClosedShell, OfSpheresIsAsClosedByNodes) {
  std::vector<Surfel> shell;
  addBall(shell, 20'000, glm::vec3(0), 1);
  for (Surfel& surfel : shell) {
    surfel.flags = kSurfelSphere;
    surfel.normal = glm::vec3(0);
    surfel.area *= 2;
    surfel.radius = std::sqrt(surfel.area / 3.14159265f);
  }
  const auto scene = IndexedScene::make(shell);
  ASSERT_TRUE(scene.ok());
  const std::vector<LocalReceiver> receivers = receiversWithin();
  for (const int pixels : {16, 32}) {
    double exact = 0;
    for (const float largest : {0.f, .02f, .08f, .2f}) {
      GatherQuality quality;
      quality.max_solid_angle = largest;
      quality.raster_resolution = pixels;
      const auto results = (*scene)->gatherTogether(receivers, {GatherMode::kOcclusion, quality});
      ASSERT_TRUE(results.ok());
      double mean = 0;
      for (const GatherResult& result : *results) mean += double(result.occlusion) / 32;
      if (largest == 0) exact = mean;
      std::printf("shell of spheres, %d pixels, %.2f sr: %.4f\n", pixels, double(largest), mean);
      EXPECT_GT(mean, exact - .0075) << largest << ' ' << pixels;
    }
  }
}

// A lone sphere is a node by itself, and covers as much as its outline.
TEST(SmallLight, SendsItsPowerFromAnyPlace) {
  std::vector<Surfel> cloud;
  addSheet(cloud, 2000, {-6, -6, -4}, {12, 0, 0}, {0, 12, 0});
  Surfel lamp;
  lamp.position = {.3f, .2f, -3};
  lamp.normal = glm::vec3(0);
  lamp.flags = kSurfelSphere;
  lamp.radius = .02f;
  lamp.area = kPi * lamp.radius * lamp.radius;
  lamp.radiosity = glm::vec3(100);
  cloud.push_back(lamp);
  std::vector<LocalReceiver> receivers;
  double truth = 0;
  for (int i = 0; i < 400; ++i) {
    const glm::vec3 at(.013f * float(i % 20), .017f * float(i / 20), 0);
    receivers.push_back({at, {0, 0, -1}});
    const glm::dvec3 to = glm::dvec3(lamp.position) - glm::dvec3(at);
    const double length_sq = glm::dot(to, to);
    truth +=
        100 * double(lamp.radius * lamp.radius) / length_sq * -to.z / std::sqrt(length_sq) / 400;
  }
  EXPECT_NEAR(meanLight(cloud, receivers, {}) / truth, 1, .01);
}

// Its normal is one of two: neither side of the sheet hides anything from who stands on it.
TEST(OwnSurface, HidesNothingOfEitherSideOfATwoSidedSheet) {
  std::vector<Surfel> sheet;
  addSheet(sheet, 4000, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  for (Surfel& surfel : sheet) surfel.flags |= kSurfelTwoSided;
  std::vector<LocalReceiver> receivers;
  for (const float side : {-1.f, 1.f}) {
    for (int i = 0; i < 64; ++i) {
      receivers.push_back({sheet[std::size_t(1000 + 31 * i)].position, {0, 0, side}});
    }
  }
  const auto scene = IndexedScene::make(sheet);
  ASSERT_TRUE(scene.ok());
  const GatherRules rules(GatherMode::kOcclusion, {});
  for (const bool alone : {false, true}) {
    const auto results = alone ? (*scene)->gatherAlone(receivers, rules)
                               : (*scene)->gatherTogether(receivers, rules);
    ASSERT_TRUE(results.ok());
    for (const GatherResult& result : *results) EXPECT_LT(result.occlusion, .02f) << alone;
  }
}

}  // namespace
}  // namespace surfeit
