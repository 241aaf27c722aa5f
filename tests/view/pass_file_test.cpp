#include "view/pass_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "io/exr_test_picture.h"
#include "io/test_directory.h"
#include "surfeit/view.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// Passes of clouds, seen from (0, 0, 10) towards the origin by 64 x 48 pixels.
class PassFileTest : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    options_.width = 64;
    options_.height = 48;
    options_.camera.eye = glm::dvec3(0, 0, 10);
    options_.camera.look_at = glm::dvec3(0);
    options_.passes = path("passes.exr");
  }

  // A disk of radius 2 with albedo and radiosity.
  std::string disk(const std::string& position, const std::string& normal) const {
    write("disk.ply",
          "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
          "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
          "property float radius\nproperty float albedo_r\nproperty float albedo_g\n"
          "property float albedo_b\nproperty float radiosity_r\nproperty float radiosity_g\n"
          "property float radiosity_b\nend_header\n" +
              position + " " + normal + " 2 0.5 0.25 0.125 3 2 1\n");
    return path("disk.ply");
  }

  Result<ViewStats> draw(const std::string& cloud, const std::string& picture = "") {
    return viewCloud(cloud, picture, options_, progress_);
  }
  float at(const std::string& channel, int x, int y) const {
    return readExrTest(path("passes.exr"), channel)[std::size_t(64 * y + x)];
  }

  ViewOptions options_;
  Progress progress_;
};

TEST_F(PassFileTest, PixelsHoldWhatTheirRayMeets) {
  const Result<ViewStats> stats = draw(disk("0 0 1", "0 0 1"));
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_GT(stats->pass_pixels, 100u);
  const float slope = std::tan(float(35 * M_PI / 360)) / 24;  // per pixel
  for (const auto& [x, y] : {std::pair(32, 24), {36, 20}, {28, 27}}) {
    EXPECT_NEAR(at("P.X", x, y), 9 * slope * (float(x) + 0.5f - 32), 1e-5);
    EXPECT_NEAR(at("P.Y", x, y), 9 * slope * (24 - float(y) - 0.5f), 1e-5);
    EXPECT_NEAR(at("P.Z", x, y), 1, 1e-5);
    EXPECT_NEAR(at("Z", x, y), 9, 1e-5);
    EXPECT_NEAR(at("N.Z", x, y), 1, 1e-6);
    EXPECT_EQ(at("A", x, y), 1);
    EXPECT_NEAR(at("albedo.G", x, y), 0.25, 1e-6);
    EXPECT_NEAR(at("radiosity.R", x, y), 3, 1e-6);
    EXPECT_NEAR(at("R", x, y), 3, 1e-3);
  }
}

TEST_F(PassFileTest, PixelsThatSeeNothingAreEmpty) {
  ASSERT_TRUE(draw(disk("0 0 1", "0 0 1")).ok());
  for (const char* channel : {"P.X", "P.Z", "N.X", "N.Z", "A", "albedo.R", "radiosity.B", "B"}) {
    EXPECT_EQ(at(channel, 0, 0), 0) << channel;
  }
  EXPECT_TRUE(std::isinf(at("Z", 0, 0)));
  // Beside the cloud nothing is seen at all, which is no error
  options_.camera.look_at = glm::dvec3(0, 0, 20);
  const Result<ViewStats> stats = draw(disk("0 0 1", "0 0 1"));
  ASSERT_TRUE(stats.ok());
  EXPECT_EQ(stats->pass_pixels, 0u);
}

TEST_F(PassFileTest, NormalsAreTurnedTowardsTheEyeExceptAlongSilhouettes) {
  ASSERT_TRUE(draw(disk("0 0 1", "0 0.6 -0.8")).ok());
  EXPECT_NEAR(at("N.Z", 32, 24), 0.8, 1e-5);
  EXPECT_NEAR(at("N.Y", 32, 24), -0.6, 1e-5);
  ASSERT_TRUE(draw(disk("0 0 1", "0 0.995 -0.1")).ok());
  EXPECT_NEAR(at("N.Y", 32, 24), 0.995, 1e-4);
}

TEST_F(PassFileTest, CameraAttributesFindThePixelOfAPosition) {
  options_.camera.eye = glm::dvec3(3, 2, 9);
  options_.camera.look_at = glm::dvec3(0.2, 0.1, 0);
  ASSERT_TRUE(draw(disk("0 0 1", "0 0 1")).ok());
  const Imf::InputFile file(path("passes.exr").c_str(), 0);
  for (const auto& [x, y] : {std::pair(32, 24), {36, 20}}) {
    const Imath::V3f position(at("P.X", x, y), at("P.Y", x, y), at("P.Z", x, y));
    const Imath::V3f camera = position * Imf::worldToCamera(file.header());
    EXPECT_NEAR(camera.z, at("Z", x, y), 1e-4);
    const Imath::V3f ndc = position * Imf::worldToNDC(file.header());  // divides by w
    EXPECT_NEAR(ndc.x * 64, float(x) + 0.5f, 1e-3);
    EXPECT_NEAR(ndc.y * 48, float(y) + 0.5f, 1e-3);
  }
}

TEST_F(PassFileTest, PictureAndPassesComeOutOfOneCall) {
  const Result<ViewStats> stats = draw(disk("0 0 1", "0 0 1"), path("picture.png"));
  ASSERT_TRUE(stats.ok());
  EXPECT_EQ(stats->channel, "radiosity");
  EXPECT_NEAR(stats->coverage * 64 * 48, double(stats->pass_pixels), 40);
  EXPECT_TRUE(std::filesystem::exists(path("picture.png")));
  EXPECT_TRUE(std::filesystem::exists(path("passes.exr")));
}

TEST_F(PassFileTest, CloudsWithoutColorsHaveNoColorPasses) {
  write("bare.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nproperty float radius\nend_header\n0 0 1 1\n");
  ASSERT_TRUE(draw(path("bare.ply")).ok());
  const Imf::InputFile file(path("passes.exr").c_str(), 0);
  EXPECT_EQ(file.header().channels().findChannel("radiosity.R"), nullptr);
  EXPECT_EQ(file.header().channels().findChannel("R"), nullptr);
  EXPECT_NEAR(at("N.Z", 32, 24), 1, 0.1);  // of the sphere
}

TEST_F(PassFileTest, RefusesWhatCannotWork) {
  const std::string cloud = disk("0 0 1", "0 0 1");
  options_.mode = ViewMode::kPoints;
  EXPECT_EQ(draw(cloud).status().code(), StatusCode::kInvalidArgument);
  options_.mode = ViewMode::kDiscs;
  options_.passes = path("passes.png");
  EXPECT_THAT(draw(cloud).status().message(), HasSubstr("expected a name in .exr"));
  options_.passes = "";
  EXPECT_EQ(draw(cloud).status().code(), StatusCode::kInvalidArgument);
  options_.passes = path("passes.exr");
  options_.memory_bytes = 1 << 20;
  EXPECT_EQ(draw(cloud).status().code(), StatusCode::kBudgetTooSmall);
  EXPECT_EQ(fileCount(), 1);
}

}  // namespace
}  // namespace surfeit
