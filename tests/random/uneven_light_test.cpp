// Light that is not even: one of several sheets shines, a part of a wall, a small lamp. A node that
// stands for all of them has one color; from afar, where it may, that must not show.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <string>
#include <vector>

#include "random/indexed_scene.h"
#include "random/random_numbers.h"
#include "random/result_differences.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

enum class Uneven { kFrontSheet, kBackSheet, kHalfWall, kStripes, kLamp };

// Squares over x and z = -1 to 1 that face -y, `gap` behind each other.
struct UnevenScene {
  Uneven light = Uneven::kFrontSheet;
  int sheets = 3;
  float gap = .15f;
  bool is_two_sided = false;
  double limit = .025, worst = .12;  // of errors of irradiance, over its mean

  bool shines(int sheet, float x, float z) const {
    switch (light) {
      case Uneven::kFrontSheet:
        return sheet == 0;
      case Uneven::kBackSheet:
        return sheet == sheets - 1;
      case Uneven::kHalfWall:
        return x + .3f * z > .1f;
      case Uneven::kStripes:
        return std::sin(23 * x + 9 * z) > .5f;
      case Uneven::kLamp:
        break;
    }
    return std::hypot(x - .3f, z + .2f) < .08f;
  }
};

constexpr int kSide = 64;  // surfels along a side

std::vector<Surfel> surfelsOf(const UnevenScene& scene, const glm::mat3& turn) {
  std::vector<Surfel> surfels;
  constexpr float kStep = 2.f / kSide;
  for (int i = 0; i < scene.sheets * kSide * kSide; ++i) {
    const int sheet = i / (kSide * kSide), row = i / kSide % kSide;
    const float x = kStep * (float(i % kSide) + .5f) - 1, z = kStep * (float(row) + .5f) - 1;
    Surfel& surfel = surfels.emplace_back();
    surfel.position = turn * glm::vec3(x, scene.gap * float(sheet), z);
    surfel.normal = turn * glm::vec3(0, -1, 0);
    surfel.area = kStep * kStep;
    surfel.radius = kStep * std::sqrt(.5f);
    surfel.radiosity = glm::vec3(scene.shines(sheet, x, z) ? 1.f : .01f);
    if (scene.is_two_sided) surfel.flags |= kSurfelTwoSided;
  }
  return surfels;
}

// Before the sheets and between them, facing anywhere.
std::vector<LocalReceiver> receiversOf(const UnevenScene& scene, const glm::mat3& turn) {
  RandomNumbers random(5);
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 200; ++i) {
    const auto between = [&](double a, double b) { return float(random.between(a, b)); };
    const float depth = i % 4 == 0 && scene.sheets > 1 ? .3f * scene.gap : -between(.3, 2.5);
    LocalReceiver& receiver = receivers.emplace_back();
    receiver.position = turn * glm::vec3(between(-1, 1), depth, between(-1, 1));
    receiver.normal = turn * glm::normalize(glm::vec3(random.direction()) + glm::vec3(0, .8f, 0));
  }
  return receivers;
}

class UnevenLight : public testing::TestWithParam<UnevenScene> {};

// As every surfel by itself lights them.
TEST_P(UnevenLight, ComesFromWhereItShines) {
  RandomNumbers random(3);
  const glm::vec3 x = glm::normalize(glm::vec3(random.direction()));
  const glm::vec3 y = glm::normalize(glm::cross(x, glm::vec3(random.direction())));
  for (const glm::mat3& turn : {glm::mat3(1), glm::mat3(x, y, glm::cross(x, y))}) {
    const auto made = IndexedScene::make(surfelsOf(GetParam(), turn));
    ASSERT_TRUE(made.ok()) << made.status().message();
    const std::vector<LocalReceiver> receivers = receiversOf(GetParam(), turn);
    GatherRules rules(GatherMode::kBleeding, {});
    const auto found = (*made)->gatherTogether(receivers, rules);
    rules.quality.max_solid_angle = 0;
    const auto exact = (*made)->gatherTogether(receivers, rules);
    ASSERT_TRUE(found.ok() && exact.ok());
    const ResultDifferences errors = differencesOf(*found, *exact);
    fmt::print("irradiance off by {:.4f} of its mean, {:.3f} at most; occlusion by {:.4f}\n",
               errors.irradiance_rms, errors.irradiance_worst, errors.rms);
    EXPECT_LE(errors.irradiance_rms, GetParam().limit);
    EXPECT_LE(errors.irradiance_worst, GetParam().worst);
    EXPECT_LE(errors.rms, .006);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, UnevenLight,
    testing::Values(UnevenScene{Uneven::kFrontSheet}, UnevenScene{Uneven::kFrontSheet, 3, .05f},
                    UnevenScene{Uneven::kFrontSheet, 3, .15f, true},
                    UnevenScene{Uneven::kBackSheet, 3, .15f, false, .9, 3.6},
                    UnevenScene{Uneven::kBackSheet, 3, .05f, true, .055, .38},
                    UnevenScene{Uneven::kBackSheet, 4, .3f, true, .075, .46},
                    UnevenScene{Uneven::kHalfWall, 1}, UnevenScene{Uneven::kHalfWall, 2, .1f, true},
                    UnevenScene{Uneven::kStripes, 1}, UnevenScene{Uneven::kLamp, 1},
                    UnevenScene{Uneven::kLamp, 3, .1f, true}));

}  // namespace
}  // namespace surfeit
