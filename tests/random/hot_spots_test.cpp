// Small things that shine on a wall: how bright it is, and that it has no steps that the light does
// not have.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <span>
#include <vector>

#include "random/closed_things.h"
#include "random/indexed_scene.h"

namespace surfeit {
namespace {

constexpr int kSide = 48;  // receivers along a side of the wall

// On a square of the plane z = 0 that looks up.
std::vector<LocalReceiver> wallOf(float size) {
  std::vector<LocalReceiver> wall;
  for (int i = 0; i < kSide * kSide; ++i) {
    const float x = float(i % kSide) / (kSide - 1) - .5f, y = float(i / kSide) / (kSide - 1) - .5f;
    wall.push_back({{size * x, size * y, 0}, {0, 0, 1}});
  }
  return wall;
}

// Of a sphere wholly above the horizon.
double irradianceOf(const glm::vec3& centre, float radius, float radiosity, const glm::vec3& at) {
  const glm::dvec3 to = glm::dvec3(centre) - glm::dvec3(at);
  const double length_sq = glm::dot(to, to);
  return double(radiosity) * double(radius) * double(radius) * to.z /
         (length_sq * std::sqrt(length_sq));
}

struct WallErrors {
  double mean;        // of the gathered over the true light, less 1
  double step_99;     // of neighbours, of gathered over true: so large are 99 %
  double worst_step;  // and all
};

WallErrors errorsOf(std::span<const Surfel> cloud, std::span<const LocalReceiver> wall,
                    std::span<const double> truth) {
  const auto scene = IndexedScene::make(cloud);
  EXPECT_TRUE(scene.ok()) << scene.status().message();
  const auto results = (*scene)->gatherTogether(wall, {GatherMode::kBleeding, {}});
  EXPECT_TRUE(results.ok()) << results.status().message();
  double sum = 0, true_sum = 0;
  std::vector<double> ratio, steps;
  for (std::size_t i = 0; i < wall.size(); ++i) {
    sum += double((*results)[i].irradiance.x);
    true_sum += truth[i];
    ratio.push_back(double((*results)[i].irradiance.x) / truth[i]);
  }
  for (std::size_t i = 0; i < wall.size(); ++i) {
    if (i % kSide != 0) steps.push_back(std::abs(ratio[i] - ratio[i - 1]));
    if (i >= kSide) steps.push_back(std::abs(ratio[i] - ratio[i - kSide]));
  }
  std::sort(steps.begin(), steps.end());
  return {sum / true_sum - 1, steps[steps.size() * 99 / 100], steps.back()};
}

std::vector<Surfel> fireOf(float radius) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<Surfel> fire;
  for (int i = 0; i < 4000; ++i) {
    Surfel flame;
    flame.position = {.25f * normal(random), uniform(random),
                      1.2f + std::clamp(.25f * normal(random), -.8f, .8f)};
    flame.normal = glm::vec3(0);
    flame.flags = kSurfelSphere;
    flame.radius = radius;
    flame.area = kPi * radius * radius;
    flame.radiosity = glm::vec3(1);
    fire.push_back(flame);
  }
  return fire;
}

// So thin that its flames do not hide each other: they add up.
TEST(HotSpots, ThinFireLightsAWall) {
  const std::vector<Surfel> fire = fireOf(.0005f);
  const std::vector<LocalReceiver> wall = wallOf(3);
  std::vector<double> truth(wall.size());
  for (std::size_t i = 0; i < wall.size(); ++i) {
    for (const Surfel& flame : fire) {
      truth[i] += irradianceOf(flame.position, flame.radius, 1, wall[i].position);
    }
  }
  const WallErrors found = errorsOf(fire, wall, truth);
  EXPECT_NEAR(found.mean, 0, .03);
  EXPECT_LE(found.step_99, .02);
  EXPECT_LE(found.worst_step, .05);
}

// Flames that hide half of each other, against the exact cut with fine pixels.
TEST(HotSpots, DenseFireLightsAWall) {
  const std::vector<Surfel> fire = fireOf(.03f);
  const std::vector<LocalReceiver> wall = wallOf(3);
  const auto scene = IndexedScene::make(fire);
  ASSERT_TRUE(scene.ok());
  GatherQuality exact;
  exact.max_solid_angle = 0;
  exact.raster_resolution = 64;
  const auto best = (*scene)->gatherTogether(wall, {GatherMode::kBleeding, exact});
  ASSERT_TRUE(best.ok());
  std::vector<double> truth;
  for (const GatherResult& result : *best) truth.push_back(double(result.irradiance.x));
  const WallErrors found = errorsOf(fire, wall, truth);
  EXPECT_NEAR(found.mean, 0, .07);  // Goal: .03, .02 and .05
  EXPECT_LE(found.step_99, .045);
  EXPECT_LE(found.worst_step, .075);
}

TEST(HotSpots, SmallBallLightsAFloor) {
  for (const float radius : {.05f, .2f}) {
    std::vector<Surfel> cloud;
    const glm::vec3 centre(.11f, .07f, .5f);
    addBall(cloud, 3000, centre, radius, 100);
    const std::vector<LocalReceiver> wall = wallOf(2);
    std::vector<double> truth;
    for (const LocalReceiver& receiver : wall) {
      truth.push_back(irradianceOf(centre, radius, 100, receiver.position));
    }
    const WallErrors found = errorsOf(cloud, wall, truth);
    EXPECT_NEAR(found.mean, 0, .03) << radius;
    EXPECT_LE(found.worst_step, .13) << radius;  // Goal: .05
  }
}

}  // namespace
}  // namespace surfeit
