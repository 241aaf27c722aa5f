// Areas that clouds of bare positions are given, whatever the sampling, beside the true ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/long_side.h"
#include "core/spherical_harmonics.h"
#include "io/test_directory.h"
#include "octree/test_scenes.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using Places = std::vector<glm::dvec2>;

class SamplingTest : public DirectoryTest {
 protected:
  static constexpr int kSide = 100;  // places along an edge of the unit square, about

  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }
  double normal() { return std::normal_distribution<double>(0, 1)(random_); }

  Places scattered(int count) {
    Places places;
    for (int i = 0; i < count; ++i) places.emplace_back(unit(), unit());
    return places;
  }
  // Rows `ratio` times as far apart as their points.
  static Places rows(double ratio) {
    const int lines = int(std::lround(kSide / std::sqrt(ratio)));
    const int points = int(std::lround(double(kSide) * kSide / lines));
    Places places;
    for (int j = 0; j < lines; ++j) {
      for (int i = 0; i < points; ++i) places.emplace_back((i + .5) / points, (j + .5) / lines);
    }
    return places;
  }
  static Places hexagons() {
    const int lines = int(std::lround(kSide * std::sqrt(2 / std::sqrt(3.))));
    const int points = int(std::lround(double(kSide) * kSide / lines));
    Places places;
    for (int j = 0; j < lines; ++j) {
      for (int i = 0; i < points; ++i) {
        places.emplace_back((i + .25 + .5 * (j % 2)) / points, (j + .5) / lines);
      }
    }
    return places;
  }

  // Adds the places on the plane through `corner` along u and v, each moved by `noise` across.
  void add(const Places& places, const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v,
           double noise = 0) {
    const glm::dvec3 across = glm::normalize(glm::cross(u, v));
    for (const glm::dvec2& place : places) {
      Surfel surfel;
      surfel.position = corner + place.x * u + place.y * v + noise * normal() * across;
      surfel.normal = across;
      surfels_.push_back(surfel);
    }
  }
  void addFlat(const Places& places, double noise = 0) {
    add(places, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, noise);
  }

  // The sum of the areas that index gives, over `area`.
  double found(double area, bool has_normals = false) {
    CloudChannels channels;
    channels.normal = has_normals;
    const std::vector<Surfel> scene = indexed(channels);
    surfels_.clear();
    double sum = 0;
    for (const Surfel& surfel : scene) sum += double(surfel.area);
    return sum / area;
  }

  std::vector<Surfel> indexed(const CloudChannels& channels) {
    EXPECT_TRUE(writeSurfels(path("cloud.ply"), surfels_, channels));
    IndexOptions options;
    options.full_precision = true;
    Progress quiet;
    const auto stats = indexClouds({path("cloud.ply")}, path("scene.sft"), options, quiet);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const Result<ReadScene> scene = readScene(path("scene.sft"));
    EXPECT_TRUE(scene.ok());
    return scene.ok() ? scene->surfels : std::vector<Surfel>();
  }
  static std::vector<float> areasOf(const std::vector<Surfel>& surfels) {
    std::vector<float> areas;
    for (const Surfel& surfel : surfels) areas.push_back(surfel.area);
    std::sort(areas.begin(), areas.end());
    return areas;
  }
  static double diskArea(const Surfel& surfel) {
    return double(kPi) * double(surfel.radius) * double(surfel.radius);
  }

  static bool writeSurfels(const std::string& file, const std::vector<Surfel>& surfels,
                           const CloudChannels& channels) {
    Result<SurfelWriter> writer = SurfelWriter::create(file, channels);
    return writer.ok() && writer->write(surfels).ok() && writer->finish().ok();
  }

  std::mt19937 random_{7};
  std::vector<Surfel> surfels_;
};

TEST_F(SamplingTest, GridsAndLinesOfAPlaneHaveItsArea) {
  addFlat(hexagons());
  EXPECT_NEAR(found(1), 1, .03) << "hexagons";
  for (const double ratio : {1., 2., 5., 10., 20.}) {
    addFlat(rows(ratio));
    EXPECT_NEAR(found(1), 1, .01) << ratio;
  }
  addFlat(scattered(kSide * kSide));
  EXPECT_NEAR(found(1), 1, .02) << "random";
}

TEST_F(SamplingTest, PlacesCountAndNotRecords) {
  const Places some = scattered(5000);
  for (int times = 1; times <= 5; times += 2) {
    for (int i = 0; i < times; ++i) addFlat(some);
    EXPECT_NEAR(found(1), 1, .02) << times;
  }
  addFlat(some);
  Places half;
  for (const glm::dvec2& place : some) {
    if (place.x < .5) half.push_back(place);
  }
  addFlat(half);
  EXPECT_NEAR(found(1), 1, .02) << "half of it twice";
  // A second scan, a hundredth of the spacing off
  addFlat(some);
  add(some, {1e-4, 0, 1e-4}, {1, 0, 0}, {0, 1, 0});
  EXPECT_NEAR(found(1), 1, .025) << "second scan";
}

TEST_F(SamplingTest, NoiseDoesNotGrowAreas) {
  for (const double noise : {.1, .2, .5}) {
    addFlat(scattered(kSide * kSide), noise / kSide);
    EXPECT_NEAR(found(1), 1, .03) << "random " << noise;
    addFlat(rows(1), noise / kSide);
    EXPECT_NEAR(found(1), 1, .03) << "grid " << noise;
  }
}

TEST_F(SamplingTest, CurvedSurfacesAndEdgesHaveTheirArea) {
  for (int i = 0; i < 20000; ++i) {
    Surfel surfel;
    surfel.position = glm::normalize(glm::dvec3(normal(), normal(), normal()));
    surfels_.push_back(surfel);
  }
  EXPECT_NEAR(found(4 * 3.14159265), 1, .01) << "sphere";
  for (const bool is_random : {false, true}) {
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 u(0), v(0), far(0);
      u[(axis + 1) % 3] = v[(axis + 2) % 3] = far[axis] = 1;
      for (const glm::dvec3& corner : {glm::dvec3(0), far}) {
        add(is_random ? scattered(3600) : rows(1), corner, u, v);
      }
    }
    EXPECT_NEAR(found(6), 1, .03) << "box";
  }
}

TEST_F(SamplingTest, WallsThatAreASpacingThickHaveTwoSides) {
  for (const bool is_random : {false, true}) {
    addFlat(is_random ? scattered(20000) : rows(1));
    add(is_random ? scattered(20000) : rows(1), {0, 0, is_random ? 1 / 141. : 1. / kSide},
        {1, 0, 0}, {0, 1, 0});
    EXPECT_NEAR(found(2), 1, .035) << is_random;
  }
}

TEST_F(SamplingTest, NormalsTellWallsApartThatAreCloserThanTheirRows) {
  for (const double ratio : {5., 20.}) {
    for (const bool is_crossed : {false, true}) {
      addFlat(rows(ratio));
      add(rows(ratio), {is_crossed ? 0. : 1., 0, -1. / kSide},
          is_crossed ? glm::dvec3(0, 1, 0) : glm::dvec3(-1, 0, 0),
          is_crossed ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0));
      EXPECT_NEAR(found(2, true), 1, .01) << ratio << " " << is_crossed;
    }
  }
  const Places some = scattered(kSide * kSide);
  for (const double height : {0., -1. / kSide}) {
    const glm::dvec3 u(height == 0 ? 1 : -1, 0, 0);
    const double x = height == 0 ? 0 : 1;
    add(some, {x, 0, height}, u, {0, 1, 0});
    add(some, {x + 5e-4, 0, height + 5e-4}, u, {0, 1, 0});
  }
  EXPECT_NEAR(found(2, true), 1, .03) << "two scans of each";
}

TEST_F(SamplingTest, DensitiesMayChangeByAThousand) {
  Places places = scattered(200000);
  for (glm::dvec2& place : places) place.x *= .5;
  const Places sparse = scattered(200);
  for (const glm::dvec2& place : sparse) places.emplace_back(.5 + .5 * place.x, place.y);
  addFlat(places);
  EXPECT_NEAR(found(1), 1, .05);
}

// Beside something a thousand times as dense all neighbours may be of another wall. Before that
// was told by normals .73 of the area were found.
TEST_F(SamplingTest, NormalsTellSparseWallsFromDenseOnes) {
  for (const bool is_back : {false, true}) {
    Places places = scattered(100000);
    for (glm::dvec2& place : places) place.x *= .5;
    for (const glm::dvec2& place : scattered(100)) places.emplace_back(.5 + .5 * place.x, place.y);
    if (is_back) {
      add(places, {0, 0, -.01}, {0, 1, 0}, {1, 0, 0});
    } else {
      addFlat(places);
    }
  }
  EXPECT_NEAR(found(2, true), 1, .1);
}

// 400 places of a floor, of group 1, below, above, before or around something 10,000 times as
// dense. .92 of the floor were found below and above what faces as it does while its places had the
// neighbours of that.
TEST_F(SamplingTest, SparseFloorsHaveTheirAreaBesideWhatIsDense) {
  const auto expectFloor = [&](const char* name) {
    add(scattered(400), {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    for (std::size_t i = surfels_.size() - 400; i < surfels_.size(); ++i) surfels_[i].group = 1;
    double floor = 0;
    for (const Surfel& surfel : indexed({.normal = true, .group = true})) {
      floor += surfel.group == 1 ? double(surfel.area) : 0;
    }
    std::printf("%s: %.3f\n", name, floor);
    EXPECT_NEAR(floor, 1, .06) << name;
    surfels_.clear();
  };
  const Places dense = scattered(40000);
  // As wide as two spacings of the floor
  for (const double height : {.01, .03, -.01}) {
    add(dense, {.4, .4, height}, {.1, 0, 0}, {0, .1, 0});
    expectFloor("a sheet that faces as the floor does");
  }
  add(dense, {.4, .4, .01}, {0, .1, 0}, {.1, 0, 0});
  expectFloor("a sheet that faces it");
  add(dense, {.4, .5, -.05}, {.1, 0, 0}, {0, 0, .1});
  expectFloor("a wall through it");
  add(dense, {.4, .5, .01}, {.1, 0, 0}, {0, .05, .09});
  expectFloor("a slope over it");
}

// Dense places have small cells at the border of theirs, so sparse ones have all that lies between.
// Cut halfway, they had .86 of a frame three spacings wide.
TEST_F(SamplingTest, SparsePlacesReachUpToWhatIsDense) {
  for (const double width : {.15, .3, .5, .8}) {
    const double low = .5 - width / 2, high = .5 + width / 2;
    double sum = 0, expected = 0;
    for (int i = 0; i < 4; ++i) {
      const glm::dvec3 corner(low, low, 0), u(width, 0, 0), v(0, width, 0);
      add(scattered(int(400'000 * width * width)), corner, u, v);
      const std::size_t dense = surfels_.size();
      for (const glm::dvec2& place : scattered(1000)) {
        const glm::dvec2 apart = glm::abs(place - .5);
        if (std::max(apart.x, apart.y) > width / 2) add({place}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
      }
      for (std::size_t k = dense; k < surfels_.size(); ++k) surfels_[k].group = 1;
      for (const Surfel& surfel : indexed({.normal = true, .group = true})) {
        if (surfel.group == 1) sum += double(surfel.area);
      }
      surfels_.clear();
      expected += 1 - width * width;
    }
    std::printf("%.2f wide: %.3f\n", high - low, sum / expected);
    EXPECT_NEAR(sum / expected, 1, .05) << width;
  }
}

// Squares of 40,000 places, ten times as far from each other as wide: the middle between them is
// nobody's.
TEST_F(SamplingTest, EdgesDoNotReachForOtherThings) {
  for (int i = 0; i < 4; ++i) add(scattered(10000), {i, 0, 0}, {.1, 0, 0}, {0, .1, 0});
  EXPECT_NEAR(found(.04, true), 1, .03) << "beside each other";
  add(scattered(40000), {0, 0, 0}, {.1, 0, 0}, {0, .1, 0});
  add(scattered(40000), {.5, 0, .2}, {.1, 0, 0}, {0, .1, 0});
  EXPECT_NEAR(found(.02, true), 1, .03) << "as on a stair";
}

// One normal of a hundred is wrong, as scans have them, and agrees with those of walls far away or
// with other wrong ones: these surfels had 435 times the area of others in the mean.
TEST_F(SamplingTest, SurfelsWithWrongNormalsStaySmall) {
  constexpr int kCount = kSide * kSide;
  addFlat(scattered(kCount));
  for (int i = 0; i < kCount; i += 100) {
    Surfel& surfel = surfels_[std::size_t(i)];
    surfel.normal = glm::normalize(glm::vec3(normal(), normal(), normal()));
    surfel.group = 1;
  }
  for (const double x : {-3., -2., 2., 3.}) {
    add(scattered(kCount), {x, -.5, -.5}, {0, 1, 0}, {0, 0, 1});
    add(scattered(kCount), {x, .5, -.5}, {0, 0, 1}, {0, 1, 0});
  }
  std::vector<float> areas;
  for (const Surfel& surfel : indexed({.normal = true, .group = true})) {
    if (surfel.group == 1) areas.push_back(surfel.area * kCount);
  }
  std::sort(areas.begin(), areas.end());
  std::printf("median %.2f, 90 %% %.2f, mean %.2f\n", double(areas[areas.size() / 2]),
              double(areas[areas.size() * 9 / 10]),
              double(std::accumulate(areas.begin(), areas.end(), 0.f)) / 100);
  EXPECT_LT(areas[areas.size() * 9 / 10], 4);
  EXPECT_LT(std::accumulate(areas.begin(), areas.end(), 0.f) / 100, 10);  // goal 2
}

TEST_F(SamplingTest, StraysStaySmall) {
  addFlat(scattered(kSide * kSide));
  for (int i = 0; i < 20; ++i) {
    Surfel stray;
    stray.position = {50 * unit(), 50 * unit(), 10 + 50 * unit()};
    surfels_.push_back(stray);
  }
  EXPECT_NEAR(found(1), 1, .5);  // each no more than 8 times the median radius
}

// Areas of a file stay to the bit, and neighbours tell the disks.
TEST_F(SamplingTest, AreasAloneStayAndDisksFillTheirCells) {
  addFlat(rows(10));
  for (Surfel& surfel : surfels_) surfel.area = float(.5 + unit()) * 1e-4f;
  const std::vector<Surfel> found = indexed({.normal = true, .area = true});
  EXPECT_EQ(areasOf(found), areasOf(surfels_));
  // Rows lie ten times as far apart as their points
  for (const Surfel& surfel : found) {
    EXPECT_NEAR(elongationOf(surfel), 10, .5);
    EXPECT_NEAR(diskArea(surfel), 1.01e-3, 3e-4);  // by the moments of 10:1
  }
}

TEST_F(SamplingTest, RadiiOfAFileStayWhereverTheyLie) {
  addFlat(scattered(2000));
  for (Surfel& surfel : surfels_) surfel.area = 5e-4f, surfel.radius = 1e-3f;
  std::vector<Surfel> found = indexed({.normal = true, .radius = true, .area = true});
  ASSERT_EQ(found.size(), surfels_.size());
  const auto isBefore = [](const Surfel& a, const Surfel& b) {
    return std::pair(a.position.x, a.position.y) < std::pair(b.position.x, b.position.y);
  };
  std::sort(found.begin(), found.end(), isBefore);
  std::sort(surfels_.begin(), surfels_.end(), isBefore);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].position, surfels_[i].position);
    EXPECT_EQ(found[i].radius, 1e-3f);
  }
}

// Confetti on the ground, a tenth of which they cover; and leaves all around.
TEST_F(SamplingTest, DisksOfWhatCoversLittleStaySmall) {
  constexpr float kArea = 1e-5f;
  addFlat(scattered(kSide * kSide));
  for (Surfel& surfel : surfels_) surfel.area = kArea, surfel.flags |= kSurfelTwoSided;
  double mean = 0;
  for (const Surfel& surfel : indexed({.normal = true, .area = true, .two_sided = true})) {
    mean += diskArea(surfel) / (kSide * kSide);
    if (surfel.elongation == 0) {
      EXPECT_LT(diskArea(surfel), 2 * 5.001 * double(kArea));
    }
  }
  EXPECT_NEAR(mean, 2 * double(kArea), .3 * 2 * double(kArea));

  surfels_.clear();
  for (int i = 0; i < 5000; ++i) {
    Surfel leaf;
    leaf.position = {unit(), unit(), unit()};
    leaf.normal = glm::normalize(glm::vec3(normal(), normal(), normal()));
    leaf.area = kArea;
    leaf.flags |= kSurfelTwoSided;
    surfels_.push_back(leaf);
  }
  for (const Surfel& surfel : indexed({.normal = true, .area = true, .two_sided = true})) {
    ASSERT_NEAR(diskArea(surfel), 2 * double(kArea), 1e-3 * double(kArea));
  }
}

// One surfel far from all others does not shrink the disks of those that come before and after it.
TEST_F(SamplingTest, StraysDoNotShrinkOthers) {
  addFlat(hexagons());
  const std::size_t count = surfels_.size();
  for (int i = 0; i < 20; ++i) {
    Surfel stray;
    stray.position = {3 * unit() - 1, -1.5 - unit(), 0};
    stray.normal = {0, 0, 1};
    surfels_.push_back(stray);
  }
  for (Surfel& surfel : surfels_) surfel.area = 1 / float(count);
  for (const Surfel& surfel : indexed({.normal = true, .area = true})) {
    if (surfel.position.y > .02 && surfel.position.y < .98) {
      EXPECT_GT(diskArea(surfel), 1.9 / double(count));
    }
    if (surfel.elongation == 0) {
      EXPECT_LT(diskArea(surfel), 10.001 / double(count));
    }
  }
}

// What a dry run says is what a run takes, about; and it leaves nothing.
TEST_F(SamplingTest, ForecastsComeTrue) {
  for (const bool has_sizes : {false, true}) {
    addFlat(scattered(400000));
    CloudChannels channels;
    channels.radius = channels.area = has_sizes;
    for (Surfel& surfel : surfels_) surfel.radius = surfel.area = .001f;
    Result<SurfelWriter> writer = SurfelWriter::create(path("cloud.ply"), channels);
    ASSERT_TRUE(writer.ok() && writer->write(surfels_).ok() && writer->finish().ok());
    surfels_.clear();
    const std::ptrdiff_t files = fileCount();
    Progress quiet;
    IndexOptions options;
    options.temporary_directory = directory_.string();
    const auto forecast = forecastIndex({path("cloud.ply")}, path("scene.sft"), options, quiet);
    ASSERT_TRUE(forecast.ok()) << forecast.status().message();
    EXPECT_EQ(fileCount(), files);
    const auto stats = indexClouds({path("cloud.ply")}, path("scene.sft"), options, quiet);
    ASSERT_TRUE(stats.ok());
    std::filesystem::remove(path("scene.sft"));
    EXPECT_EQ(forecast->records, 400000u);
    EXPECT_NEAR(double(forecast->file_bytes) / double(stats->file_bytes), 1, .35);
    EXPECT_GT(forecast->seconds, 0);
    if (!has_sizes) {
      EXPECT_NEAR(double(forecast->temporary_bytes) / double(stats->temporary_bytes), 1, .35);
    }
  }
}

TEST_F(SamplingTest, ForecastsRefuseWhatCannotBeDone) {
  Progress quiet;
  EXPECT_EQ(forecastIndex({}, path("a.sft"), {}, quiet).status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(forecastIndex({path("gone.ply")}, path("a.sft"), {}, quiet).status().code(),
            StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
