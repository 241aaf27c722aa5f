#include "view/disk_raster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

namespace surfeit {
namespace {

constexpr int kSize = 400;

// Looks along -z from (0, 0, 10); at the origin a unit of length is 1 / (10 slopeStep) samples.
Camera testCamera() {
  CameraOptions options;
  options.eye = glm::dvec3(0, 0, 10);
  options.look_at = glm::dvec3(0);
  Bounds3d bounds;
  bounds.add(glm::dvec3(-1));
  bounds.add(glm::dvec3(1));
  Result<ViewFrame> frame = Camera::createFrame(options, kSize, kSize);
  return *Camera::create(options, bounds, *frame, kSize, kSize);
}

std::vector<Fragment> fragments(const ScreenSurfel& surfel, const Camera& camera) {
  std::vector<Fragment> found;
  for (int y = surfel.box.y_begin; y < surfel.box.y_end; ++y) {
    visitFragments(surfel, camera, y, [&](const Fragment& fragment) { found.push_back(fragment); });
  }
  return found;
}

CloudRecord disk(const glm::dvec3& position, const glm::vec3& normal, float radius) {
  CloudRecord record;
  record.position = position;
  record.normal = normal == glm::vec3(0) ? normal : glm::normalize(normal);
  record.radius = radius;
  return record;
}

TEST(DiskRaster, FacingDiskCoversItsAnalyticArea) {
  const Camera camera = testCamera();
  const auto surfel = projectDisk(disk({0.3, -0.2, 0}, {0, 0, 1}, 1), camera);
  ASSERT_TRUE(surfel.has_value());
  const double radius = 1 / (10 * double(camera.slopeStep()));
  const double area = std::numbers::pi * radius * radius;
  EXPECT_NEAR(double(fragments(*surfel, camera).size()), area, 0.005 * area);
}

TEST(DiskRaster, TiltedDiskIsForeshortened) {
  // Far away and small, so that perspective is weak
  const Camera camera = testCamera();
  const auto surfel = projectDisk(disk({0, 0, 0}, {0, std::sqrt(3.f), 1}, 0.5f), camera);
  ASSERT_TRUE(surfel.has_value());
  const double radius = 0.5 / (10 * double(camera.slopeStep()));
  const double area = 0.5 * std::numbers::pi * radius * radius;
  EXPECT_NEAR(double(fragments(*surfel, camera).size()), area, 0.01 * area);
}

TEST(DiskRaster, FragmentsLieOnTheDisk) {
  const Camera camera = testCamera();
  const CloudRecord record = disk({1, 0.5, 2}, {0.4f, -0.3f, 0.6f}, 0.7f);
  const auto surfel = projectDisk(record, camera);
  ASSERT_TRUE(surfel.has_value());
  const std::vector<Fragment> found = fragments(*surfel, camera);
  ASSERT_GT(found.size(), 100u);
  for (const Fragment& fragment : found) {
    const glm::vec3 hit = fragment.depth * fragment.slope - surfel->centre;
    EXPECT_NEAR(glm::dot(hit, surfel->normal), 0, 1e-4);
    EXPECT_LE(glm::length(hit), 0.7f * 1.0001f);
    EXPECT_NEAR(fragment.rho, glm::dot(hit, hit) / (0.7f * 0.7f), 1e-4);
  }
}

TEST(DiskRaster, BoxIsTheSmallestThatHoldsTheDisk) {
  const Camera camera = testCamera();
  for (const glm::vec3 normal :
       {glm::vec3(0, 0, 1), glm::vec3(1, 0.2f, 0.5f), glm::vec3(0.3f, -1, 0.2f), glm::vec3(0)}) {
    const auto surfel = projectDisk(disk({0.5, -1, 3}, normal, 0.6f), camera);
    ASSERT_TRUE(surfel.has_value());
    int x_begin = kSize, x_end = 0;
    for (const Fragment& fragment : fragments(*surfel, camera)) {
      x_begin = std::min(x_begin, fragment.x);
      x_end = std::max(x_end, fragment.x + 1);
    }
    // The extreme samples may just miss the tip of the ellipse
    EXPECT_NEAR(x_begin, surfel->box.x_begin, 2);
    EXPECT_NEAR(x_end, surfel->box.x_end, 2);
  }
}

TEST(DiskRaster, SphereBulgesTowardsTheEye) {
  const Camera camera = testCamera();
  const auto surfel = projectDisk(disk({0, 0, 0}, glm::vec3(0), 1), camera);
  ASSERT_TRUE(surfel.has_value());
  float nearest = 1e9f;
  for (const Fragment& fragment : fragments(*surfel, camera)) {
    EXPECT_NEAR(glm::length(fragment.depth * fragment.slope - surfel->centre), 1, 1e-4);
    nearest = std::min(nearest, fragment.depth);
  }
  EXPECT_NEAR(nearest, 9, 1e-3);
}

TEST(DiskRaster, TinyDisksStillCoverASample) {
  const Camera camera = testCamera();
  for (int i = 0; i < 50; ++i) {
    const auto surfel =
        projectDisk(disk({0.0137 * i, -0.0071 * i, 0}, {0.1f * float(i), 0, 1}, 1e-6f), camera);
    ASSERT_TRUE(surfel.has_value());
    EXPECT_GE(fragments(*surfel, camera).size(), 1u);
    EXPECT_LE(fragments(*surfel, camera).size(), 4u);
  }
}

TEST(DiskRaster, NothingBehindTheEyeIsSeen) {
  const Camera camera = testCamera();
  EXPECT_FALSE(projectDisk(disk({0, 0, 12}, {0, 0, 1}, 1), camera).has_value());
  EXPECT_FALSE(projectSquare(disk({0, 0, 12}, {0, 0, 1}, 1), camera, 2).has_value());
}

TEST(DiskRaster, DiskThroughTheEyePlaneIsDrawnWhereItIsSeen) {
  // A floor one unit below the eye that reaches from behind it to far in front
  const Camera camera = testCamera();
  const auto surfel = projectDisk(disk({0, -1, 10}, {0, 1, 0}, 100), camera);
  ASSERT_TRUE(surfel.has_value());
  const std::size_t covered = fragments(*surfel, camera).size();
  EXPECT_GT(covered, std::size_t(kSize * kSize * 45 / 100));
  EXPECT_LE(covered, std::size_t(kSize * kSize / 2));
}

TEST(DiskRaster, DisksBesideTheEyeAreNotSoughtOnTheScreen) {
  // They cross the eye's plane, so the conic has no bounds; there may be thousands of them
  const Camera camera = testCamera();
  EXPECT_FALSE(projectDisk(disk({3, 0, 10}, {0, 0.1f, 1}, 0.1f), camera).has_value());
  EXPECT_FALSE(projectDisk(disk({0, -3, 10}, {0, 1, 0}, 0.1f), camera).has_value());
}

TEST(DiskRaster, SquaresHaveExactlyTheirSize) {
  const Camera camera = testCamera();
  for (int i = 0; i < 20; ++i) {
    const auto surfel = projectSquare(disk({0.013 * i, 0.007 * i, 0}, {0, 0, 1}, 1), camera, 3);
    ASSERT_TRUE(surfel.has_value());
    EXPECT_EQ(fragments(*surfel, camera).size(), 9u);
  }
}

}  // namespace
}  // namespace surfeit
