// Occlusion by the brightness of the environment against sums over directions, with spheres that
// rays meet where algebra says.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <vector>

#include "batch/environment_file.h"
#include "gather/environment_pictures.h"
#include "gather/light/environment_map.h"
#include "gather/packet_clouds.h"
#include "gather/test_clouds.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

// A sky with a warm sunset, dark on the other side and below.
glm::vec3 sunset(const glm::dvec3& direction) {
  const double glow =
      std::exp(6 * (glm::dot(direction, glm::normalize(glm::dvec3(1, .3, .4))) - 1));
  return glm::vec3(.02, .03, .05) + float(glow) * glm::vec3(9, 5, 2);
}

struct Ball {
  glm::dvec3 centre{0};
  double radius = 1;
};

bool isHit(const glm::dvec3& from, const glm::dvec3& direction, const Ball& ball) {
  const glm::dvec3 to = ball.centre - from;
  const double along = glm::dot(to, direction);
  return along > 0 && glm::dot(to, to) - along * along < ball.radius * ball.radius;
}

class Brightness : public testing::Test {
 protected:
  // The gather's occlusion at a place that faces up, by brightness or by directions.
  float occlusion(const std::vector<Ball>& balls, const glm::vec3& at, bool by_brightness,
                  const std::function<glm::vec3(const glm::dvec3&)>& sky) {
    const std::string path = directory_.file("sky.exr");
    writeExr(TestPicture(512, 256,
                         [&](int column, int row) {
                           return sky(latLongDirection((column + .5) / 512, (row + .5) / 256));
                         }),
             path);
    Cloud cloud;
    for (const Ball& ball : balls) {
      addSphere(cloud, 20000, glm::vec3(ball.centre), float(ball.radius));
    }
    TestScene scene(cloud);
    GatherQuality quality;
    setQuality(QualityPreset::kFinal, quality);
    GatherEnvironment environment;
    environment.path = path;
    environment.up = UpAxis::kZ;
    Progress progress;
    Result<EnvironmentMap> map = loadEnvironmentMap(environment, progress);
    EXPECT_TRUE(map.ok()) << map.status().message();
    const EnvironmentCube cube(*map, RasterGeometry(quality.raster_resolution));
    GatherRules rules(GatherMode::kOcclusion, quality);
    rules.environment = &*map;
    rules.environment_cube = &cube;
    rules.weights.by_brightness = by_brightness;
    return scene.gather({at, {0, 0, 1}}, rules).occlusion;
  }
  // The same by many directions: the sum of cosine times luminance where something is hit, over
  // that of all.
  static double bySum(const std::vector<Ball>& balls, const glm::vec3& at,
                      const std::function<glm::vec3(const glm::dvec3&)>& sky) {
    constexpr int kSteps = 700;
    double hit = 0, all = 0;
    for (int i = 0; i < kSteps; ++i) {
      for (int k = 0; k < kSteps; ++k) {
        // Even in cosine-weighted solid angle
        const double sine = std::sqrt((i + .5) / kSteps), phi = 6.283185307 * (k + .5) / kSteps;
        const glm::dvec3 direction(sine * std::cos(phi), sine * std::sin(phi),
                                   std::sqrt(1 - sine * sine));
        const glm::dvec3 light(sky(direction));
        const double bright = .2126 * light.r + .7152 * light.g + .0722 * light.b;
        all += bright;
        for (const Ball& ball : balls) {
          if (!isHit(glm::dvec3(at), direction, ball)) continue;
          hit += bright;
          break;
        }
      }
    }
    return hit / all;
  }

  TestDirectory directory_;
};

TEST_F(Brightness, OcclusionIsTheCoveredPartOfTheLight) {
  const std::vector<Ball> balls = {{{2, .5, 1}, 1}, {{-1.5, -1, .8}, .7}};
  for (const glm::vec3& at : {glm::vec3(0, 0, 0), glm::vec3(.4f, -.2f, 0), glm::vec3(-.6f, 1, 0)}) {
    const double expected = bySum(balls, at, sunset);
    const double plain = bySum(balls, at, [](const glm::dvec3&) { return glm::vec3(1); });
    EXPECT_NEAR(occlusion(balls, at, true, sunset), expected, .01);
    EXPECT_NEAR(occlusion(balls, at, false, sunset), plain, .005);
    EXPECT_GT(std::abs(expected - plain), .05);  // or the test would show nothing
  }
}

TEST_F(Brightness, AnEvenSkyWeighsNothing) {
  const std::vector<Ball> balls = {{{1, .5, 1}, .8}};
  const auto even = [](const glm::dvec3&) { return glm::vec3(.3f, .5f, .2f); };
  EXPECT_NEAR(occlusion(balls, {0, 0, 0}, true, even), occlusion(balls, {0, 0, 0}, false, even),
              1e-5f);
}

TEST_F(Brightness, WhatHidesTheOnlyLightHidesAll) {
  const glm::dvec3 sun = glm::normalize(glm::dvec3(1, 0, 1));
  const auto only_sun = [&](const glm::dvec3& direction) {
    return glm::vec3(glm::dot(direction, sun) > .995 ? 100.f : 0.f);
  };
  EXPECT_GT(occlusion({{2. * sun, .6}}, {0, 0, 0}, true, only_sun), .99f);
  EXPECT_LT(occlusion({{{-1, 0, 1}, .6}}, {0, 0, 0}, true, only_sun), 1e-4f);
  EXPECT_EQ(occlusion({{{-1, 0, 1}, .6}}, {0, 0, 0}, true,
                      [](const glm::dvec3&) { return glm::vec3(0); }),
            0);
}

TEST_F(Brightness, NeedsAnEnvironmentAndTheOcclusion) {
  makeScene(floorAndSphere(10), directory_.file("s.sft"));
  writeTable(receiversOf(10), directory_.file("r.ply"));
  GatherOptions options;
  options.weights.by_brightness = true;
  Progress progress;
  const auto message = [&] {
    const Status status = gatherCloud(directory_.file("s.sft"), directory_.file("r.ply"),
                                      directory_.file("none.ply"), options, progress)
                              .status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    return status.message();
  };
  EXPECT_NE(message().find("--environment"), std::string::npos);
  options.environment.path = "sky.exr";
  options.outputs = kOutputBentNormal;
  EXPECT_NE(message().find("no output occlusion"), std::string::npos);
}

}  // namespace
}  // namespace surfeit
