// Lights through the whole gather, from files to files.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gather/environment_pictures.h"
#include "gather/test_clouds.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"

namespace surfeit {
namespace {

class LightCloud : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(40), scene_);
    writeTable(receiversOf(3000), receivers_);
    writeExr(TestPicture(64, 32, [](int, int row) { return glm::vec3(row < 16 ? 2.f : .5f); }),
             directory_.file("sky.exr"));
  }

  static GatherOptions options() {
    GatherOptions options;
    options.quality.max_solid_angle = .3f;
    options.quality.raster_resolution = 6;
    options.threads = 1;
    options.memory_bytes = 256 << 20;
    return options;
  }
  Status gather(const GatherOptions& options) {
    return gatherCloud(scene_, receivers_, result_, options, progress_).status();
  }
  Table gatherTable(const GatherOptions& options) {
    const Status status = gather(options);
    EXPECT_TRUE(status.ok()) << status.message();
    return status.ok() ? readTable(result_) : Table();
  }
  void expectRefused(const GatherOptions& options, StatusCode code, const std::string& text) {
    const Status status = gather(options);
    EXPECT_EQ(status.code(), code) << status.message();
    EXPECT_NE(status.message().find(text), std::string::npos) << status.message();
    EXPECT_FALSE(std::filesystem::exists(result_));
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  Progress progress_;
};

TEST_F(LightCloud, OutputsArePropertiesOfTheResult) {
  GatherOptions all = options();
  all.mode = GatherMode::kBleeding;
  all.environment.path = directory_.file("sky.exr");
  all.outputs = kOutputOcclusion | kOutputIrradiance | kOutputBentNormal |
                kOutputIlluminationDirection | kOutputEnvironment | kOutputFluence |
                kOutputRadianceSh;
  const Table table = gatherTable(all);
  for (const char* name : {"occlusion", "irradiance_r", "bent_normal_z", "environment_b",
                           "illumination_direction_x", "fluence_g", "sh0_r", "sh8_b"}) {
    EXPECT_EQ(table.column(name).size(), 3000u) << name;
  }
  // Each output alone is what it is among all
  GatherOptions bent = options();
  bent.outputs = kOutputBentNormal;
  EXPECT_EQ(gatherTable(bent).column("bent_normal_y"), table.column("bent_normal_y"));
  GatherOptions plain = options();
  EXPECT_EQ(gatherTable(plain).column("occlusion"), table.column("occlusion"));
  EXPECT_TRUE(gatherTable(plain).column("irradiance_r").empty());
}

TEST_F(LightCloud, EnvironmentComesWithTheModeAndFillsWhatIsOpen) {
  GatherOptions lit = options();
  lit.environment.path = directory_.file("sky.exr");
  lit.environment.up = UpAxis::kZ;
  const Table table = gatherTable(lit);
  const std::vector<double> open = table.column("occlusion"), light = table.column("environment_r");
  const std::vector<double> up = table.column("nz");
  ASSERT_EQ(light.size(), 3000u);
  for (std::size_t i = 0; i < light.size(); ++i) {
    // Where all of the sky's upper half is above
    if (up[i] == 1) {
      EXPECT_NEAR(light[i], (1 - open[i]) * 2 * 3.14159265, .02);
    }
  }
  lit.environment.intensity = 3;
  const std::vector<double> brighter = gatherTable(lit).column("environment_r");
  for (std::size_t i = 0; i < light.size(); ++i) EXPECT_NEAR(brighter[i], 3 * light[i], 1e-4);
}

TEST_F(LightCloud, MemoryAndThreadsDoNotChangeTheLights) {
  GatherOptions lit = options();
  lit.mode = GatherMode::kBleeding;
  lit.environment.path = directory_.file("sky.exr");
  lit.environment.up = UpAxis::kZ;
  lit.weights.falloff = .5f;
  lit.outputs = kOutputOcclusion | kOutputIrradiance | kOutputEnvironment | kOutputRadianceSh;
  ASSERT_TRUE(gather(lit).ok());
  const std::string expected = readBytes(result_);
  lit.threads = 3;
  lit.memory_bytes = 48 << 20;
  const Status status = gather(lit);
  ASSERT_TRUE(status.ok()) << status.message();
  EXPECT_EQ(readBytes(result_), expected);
}

TEST_F(LightCloud, GlossyViewsComeFromTheCameraOrTheReceivers) {
  GatherOptions glossy = options();
  glossy.mode = GatherMode::kGlossy;
  expectRefused(glossy, StatusCode::kCorruption, "view_x view_y view_z");
  glossy.eye = {0, -6, 2};
  const Table from_camera = gatherTable(glossy);
  ASSERT_EQ(from_camera.column("reflection_g").size(), 3000u);

  Table receivers = receiversOf(3000);
  for (const char* name : {"view_x", "view_y", "view_z"}) receivers.addProperty(name);
  for (std::vector<double>& row : receivers.rows) {
    for (const double value : {row[0] - 0, row[1] + 6, row[2] - 2}) row.push_back(value);
  }
  writeTable(receivers, receivers_);
  glossy.eye = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  const std::vector<double> from_data = gatherTable(glossy).column("reflection_g");
  const std::vector<double> expected = from_camera.column("reflection_g");
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(from_data[i], expected[i], .02);
}

TEST_F(LightCloud, WhatCannotBeIsRefusedBeforeWorkStarts) {
  GatherOptions wrong = options();
  wrong.outputs = kOutputEnvironment;
  expectRefused(wrong, StatusCode::kInvalidArgument, "--environment");
  wrong = options();
  wrong.environment.path = directory_.file("no.exr");
  expectRefused(wrong, StatusCode::kIoError, "no.exr");
  wrong.environment.path = receivers_;
  expectRefused(wrong, StatusCode::kCorruption, receivers_);
  wrong = options();
  wrong.weights.falloff = 1;
  wrong.weights.falloff_mode = GatherWeights::FalloffMode::kPolynomial;
  expectRefused(wrong, StatusCode::kInvalidArgument, "max distance");
  wrong = options();
  wrong.weights.cone_angle = 2;
  expectRefused(wrong, StatusCode::kInvalidArgument, "cone angle");
  wrong = options();
  wrong.weights.roughness = 0;
  expectRefused(wrong, StatusCode::kInvalidArgument, "roughness");
}

}  // namespace
}  // namespace surfeit
