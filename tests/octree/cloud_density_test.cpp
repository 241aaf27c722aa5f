#include "index/clouds/cloud_density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "index/rows/scene_rows.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

class CloudDensityTest : public SceneTest {
 protected:
  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }

  // `count` points at random on a square of that side.
  std::vector<glm::dvec3> square(std::size_t count, double side, const glm::dvec3& corner = {}) {
    std::vector<glm::dvec3> points;
    for (std::size_t i = 0; i < count; ++i) {
      points.push_back(corner + side * glm::dvec3(unit(), unit(), 0));
    }
    return points;
  }

  void writePoints(const std::vector<glm::dvec3>& points) {
    std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                       std::to_string(points.size()) +
                       "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
    const std::size_t header = text.size();
    text.resize(header + points.size() * sizeof(glm::dvec3));
    std::memcpy(text.data() + header, points.data(), points.size() * sizeof(glm::dvec3));
    write("cloud.ply", text);
  }

  CloudDensity densityOf(const std::vector<glm::dvec3>& points, const glm::dvec3& origin = {}) {
    writePoints(points);
    const auto source = openCloudSource(path("cloud.ply"), false);
    EXPECT_TRUE(source.ok()) << source.status().message();
    if (!source.ok()) return {};
    (*source)->setOrigin(origin);
    PlaceSample sample((*source)->recordCount());
    std::vector<Surfel> batch(1000);
    for (;;) {
      const auto count = (*source)->read(batch);
      EXPECT_TRUE(count.ok());
      if (!count.ok() || *count == 0) break;
      sample.add(std::span(batch).first(*count));
    }
    EXPECT_EQ(sample.surfelCount(), points.size());
    const auto density = measureDensity(**source, sample, counter_);
    EXPECT_TRUE(density.ok()) << density.status().message();
    EXPECT_EQ(density->sampled, std::min<std::uint64_t>(points.size(), 1000));
    return *density;
  }

  // How often the cloud is read.
  class Counter : public Progress {
   public:
    void beginPhase(std::string_view, std::uint64_t, std::string_view) override { ++passes; }
    int passes = 0;
  };

  std::mt19937 random_{3};
  Counter counter_;
};

TEST_F(CloudDensityTest, RandomPlanesHaveTheirSpacing) {
  const CloudDensity density = densityOf(square(200000, 10));
  const double spacing = 10 / std::sqrt(200000.0);
  EXPECT_NEAR(density.median_spacing, spacing, 0.1 * spacing);
  EXPECT_NEAR(density.low_spacing, 0.7 * spacing, 0.1 * spacing);
  EXPECT_NEAR(density.high_spacing, 1.3 * spacing, 0.15 * spacing);
  EXPECT_NEAR(density.points_per_area, 2000, 400);
  EXPECT_EQ(density.repeated_share, 0);
  EXPECT_EQ(counter_.passes, 1);
}

TEST_F(CloudDensityTest, GridsHaveTheirSpacing) {
  std::vector<glm::dvec3> points;
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 300; ++x) points.emplace_back(0.5 * x, 0.5 * y, 1);
  }
  const CloudDensity density = densityOf(points);
  EXPECT_NEAR(density.median_spacing, 0.443, 0.001);  // 8 neighbours within sqrt(2) steps
}

TEST_F(CloudDensityTest, QuantilesTellDensitiesApart) {
  std::vector<glm::dvec3> points = square(100000, 1);
  const std::vector<glm::dvec3> sparse = square(100000, 10, {20, 0, 0});
  points.insert(points.end(), sparse.begin(), sparse.end());
  std::shuffle(points.begin(), points.end(), random_);
  const CloudDensity density = densityOf(points);
  const double spacing = 1 / std::sqrt(100000.0);
  EXPECT_NEAR(density.low_spacing, 0.77 * spacing, 0.15 * spacing);
  EXPECT_NEAR(density.high_spacing, 12.2 * spacing, 1.5 * spacing);
}

TEST_F(CloudDensityTest, RepeatedPointsAreOnePlace) {
  const std::vector<glm::dvec3> once = square(50000, 10);
  const double spacing = 10 / std::sqrt(50000.0);
  std::vector<glm::dvec3> points = once;
  points.insert(points.end(), once.begin(), once.end());
  CloudDensity density = densityOf(points);
  EXPECT_EQ(density.repeated_share, 1);
  EXPECT_NEAR(density.median_spacing, spacing, 0.1 * spacing);
  EXPECT_NEAR(density.points_per_area, 1000, 200);
  // Half of the places, whatever the order
  points.resize(75000);
  density = densityOf(points);
  EXPECT_NEAR(density.repeated_share, 0.5, 0.05);
  std::shuffle(points.begin(), points.end(), random_);
  density = densityOf(points);
  EXPECT_NEAR(density.repeated_share, 0.5, 0.05);
  EXPECT_NEAR(density.median_spacing, spacing, 0.1 * spacing);
}

TEST_F(CloudDensityTest, CoordinatesOfMapsKeepTheirDigits) {
  const glm::dvec3 corner(500000, 5000000, 300);
  const CloudDensity density = densityOf(square(100000, 100, corner), corner);
  EXPECT_NEAR(density.median_spacing, 0.316, 0.03);
  EXPECT_LT(density.repeated_share, 0.01);
}

// Half of the points are a speck, the rest fills space: the sample tells neither at first.
TEST_F(CloudDensityTest, SpecksAndVolumesAreFoundByLookingAgain) {
  std::vector<glm::dvec3> points;
  for (int i = 0; i < 200000; ++i) {
    const glm::dvec3 place(unit(), unit(), unit());
    points.push_back(i % 2 == 0 ? place : place * 1e-5 + glm::dvec3(0.5));
  }
  const CloudDensity density = densityOf(points);
  EXPECT_LE(counter_.passes, 3);
  // The distance to the 8th of 100,000 places in a unit cube
  const double near = std::cbrt(8 / (4.18879 * 1e5));
  EXPECT_NEAR(density.high_spacing, std::sqrt(3.14159 / 8) * near, 0.3 * near);
  EXPECT_LT(density.low_spacing, 1e-5);
}

TEST_F(CloudDensityTest, SmallCloudsAreMeasuredWhole) {
  CloudDensity density = densityOf({{0, 0, 0}, {3, 0, 0}, {0, 4, 0}});
  EXPECT_NEAR(density.median_spacing, std::sqrt(3.14159265 * 25 / 2), 1e-3);
  EXPECT_EQ(density.repeated_share, 0);
  density = densityOf({{1, 2, 3}});
  EXPECT_EQ(density.median_spacing, 0);
  density = densityOf(std::vector<glm::dvec3>(5000, glm::dvec3(1, 2, 3)));
  EXPECT_EQ(density.median_spacing, 0);
  EXPECT_EQ(density.points_per_area, 0);
  EXPECT_EQ(density.repeated_share, 1);
  // One crowd, and one point far from it that no sample has
  std::vector<glm::dvec3> points(5000, glm::dvec3(1, 2, 3));
  points[7] = {1, 2, 5};
  density = densityOf(points);
  EXPECT_NEAR(density.median_spacing, 2 * std::sqrt(3.14159265), 1e-3);
}

TEST_F(CloudDensityTest, ScenesAreAsDenseAsTheirClouds) {
  const std::vector<glm::dvec3> points = square(50000, 10);
  const CloudDensity expected = densityOf(points);
  IndexOptions options;
  options.full_precision = true;
  indexFiles({path("cloud.ply"), path("cloud.ply")}, path("scene.sft"), options);
  auto scene = SceneFile::open(path("scene.sft"));
  ASSERT_TRUE(scene.ok());
  const auto density = measureDensity(std::move(*scene), counter_);
  ASSERT_TRUE(density.ok()) << density.status().message();
  EXPECT_NEAR(density->median_spacing, expected.median_spacing, 0.05 * expected.median_spacing);
  EXPECT_EQ(density->repeated_share, 1);
  EXPECT_NEAR(density->points_per_area, 2 * expected.points_per_area,
              0.2 * expected.points_per_area);
}

}  // namespace
}  // namespace surfeit
