// Brick maps made of clouds and looked up again.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/job_limits.h"
#include "io/test_directory.h"
#include "surfeit/brick.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// A point of the clouds of these tests.
struct Point {
  float x = 0, y = 0, z = 0, nx = 0, ny = 0, nz = 0, area = 0, value = 0;
};

class Brick : public DirectoryTest {
 protected:
  std::string cloud(const std::string& name, const std::vector<Point>& points) const {
    std::string text = fmt::format(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n"
        "property float y\nproperty float z\nproperty float nx\nproperty float ny\n"
        "property float nz\nproperty float area\nproperty float occlusion\nend_header\n",
        points.size());
    text.append(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(Point));
    write(name, text);
    return path(name);
  }

  // A square of n x n points at height z, edge 1, facing up or down.
  template <typename Value>
  static std::vector<Point> square(int n, float z, float nz, Value value) {
    std::vector<Point> points;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const float x = (float(i) + 0.5f) / float(n), y = (float(j) + 0.5f) / float(n);
        points.push_back({x, y, z, 0, 0, nz, 1 / float(n * n), value(x, y)});
      }
    }
    return points;
  }

  // A sphere of radius 1 around the origin, of random points.
  template <typename Value>
  static std::vector<Point> sphere(int n, Value value) {
    std::mt19937 random(5);
    std::normal_distribution<float> normal;
    std::vector<Point> points;
    for (int i = 0; i < n; ++i) {
      glm::vec3 p(normal(random), normal(random), normal(random));
      p /= std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
      points.push_back({p.x, p.y, p.z, p.x, p.y, p.z, 12.566f / float(n), value(p)});
    }
    return points;
  }

  BrickStats brick(const std::vector<std::string>& inputs, const std::string& name = "out.vdb") {
    const Result<BrickStats> stats = brickClouds(inputs, path(name), options_, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? *stats : BrickStats();
  }

  BrickMap open(const std::string& name = "out.vdb",
                std::uint64_t memory_bytes = std::uint64_t{64} << 20) const {
    Result<BrickMap> map = BrickMap::open(path(name), memory_bytes);
    EXPECT_TRUE(map.ok()) << map.status().message();
    return std::move(*map);
  }

  // The value at a place, or NaN where there is none.
  static double at(const BrickMap& map, const glm::dvec3& position, const glm::vec3& normal,
                   double filter_width = 0) {
    std::vector<float> values(map.valueCount());
    const Result<bool> found = map.lookup(position, normal, filter_width, &values[0]);
    EXPECT_TRUE(found.ok()) << found.status().message();
    return found.ok() && *found ? double(values[0]) : std::numeric_limits<double>::quiet_NaN();
  }

  // Largest error of look-ups at the points of a cloud.
  static double largestError(const BrickMap& map, const std::vector<Point>& points) {
    double largest = 0;
    for (const Point& point : points) {
      const double found =
          at(map, glm::dvec3(point.x, point.y, point.z), glm::vec3(point.nx, point.ny, point.nz));
      EXPECT_TRUE(std::isfinite(found));
      largest = std::max(largest, std::abs(found - double(point.value)));
    }
    return largest;
  }

  static std::uint64_t voxels(const BrickStats& stats) {
    std::uint64_t sum = 0;
    for (const std::uint64_t level : stats.level_voxels) sum += level;
    return sum;
  }

  struct Notes : Progress {
    void note(const std::string& message) override { text += message + "\n"; }
    std::string text;
  };

  BrickOptions options_;
  Notes progress_;
};

TEST_F(Brick, ConstantFieldIsOneCoarseLevel) {
  const std::vector<Point> points = sphere(40000, [](const glm::vec3&) { return 0.25f; });
  const BrickStats stats = brick({cloud("a.ply", points)});
  ASSERT_GT(stats.level_voxels.size(), 3u);
  for (std::size_t level = 0; level + 1 < stats.level_voxels.size(); ++level) {
    EXPECT_EQ(stats.level_voxels[level], 0u) << level;
  }
  EXPECT_LE(stats.level_voxels.back(), 8u * 8 * 8 * 6);
  EXPECT_LT(largestError(open(), points), 1e-6);
}

TEST_F(Brick, LinearFieldIsWithinTheMaxError) {
  const std::vector<Point> points =
      square(200, 0.1f, 1, [](float x, float y) { return 0.6f * x + 0.3f * y; });
  for (const double max_error : {0.02, 0.1}) {
    options_.max_error = max_error;
    const BrickStats stats = brick({cloud("a.ply", points)});
    EXPECT_LE(largestError(open(), points), max_error);
    EXPECT_GT(voxels(stats), 10u);
  }
}

TEST_F(Brick, SmallerErrorsTakeMoreVoxels) {
  const std::vector<Point> points =
      sphere(100000, [](const glm::vec3& p) { return 0.5f + 0.5f * std::sin(5 * p.x); });
  const std::string input = cloud("a.ply", points);
  std::uint64_t last = 0;
  for (const double max_error : {0.2, 0.05, 0.01}) {
    options_.max_error = max_error;
    const std::uint64_t found = voxels(brick({input}));
    EXPECT_GT(found, 3 * last / 2);
    last = found;
    // The finest voxels are means, too: by how much, their size decides
    EXPECT_LE(largestError(open(), points), max_error + 0.03);
  }
}

TEST_F(Brick, ThinWallsKeepTheirSidesApart) {
  // Closer than a voxel, also of the finest
  std::vector<Point> points = square(100, 0.5f, 1, [](float, float) { return 1.0f; });
  const auto back = square(100, 0.4999f, -1, [](float x, float) { return 0.2f * x; });
  points.insert(points.end(), back.begin(), back.end());
  brick({cloud("a.ply", points)});
  const BrickMap map = open();
  for (const double width : {0.0, 0.05, 0.5, 10.0}) {
    EXPECT_NEAR(at(map, {0.5, 0.5, 0.5}, {0, 0, 1}, width), 1, 1e-6);
    EXPECT_NEAR(at(map, {0.5, 0.5, 0.5}, {0, 0, -1}, width), 0.1, 0.02);
    EXPECT_NEAR(at(map, {0.5, 0.5, 0.5}, {0.3f, -0.2f, 0.9f}, width), 1, 1e-6);
  }
  // Nothing faces that way
  EXPECT_TRUE(std::isnan(at(map, {0.5, 0.5, 0.5}, {1, 0, 0})));
}

TEST_F(Brick, LookupsOutsideGiveNothing) {
  brick({cloud("a.ply", square(50, 0, 1, [](float x, float) { return x; }))});
  const BrickMap map = open();
  const double far = std::numeric_limits<double>::max();
  for (const glm::dvec3& place :
       {glm::dvec3(5, 0, 0), glm::dvec3(0.5, 0.5, 3), glm::dvec3(far, 0, 0),
        glm::dvec3(std::nan(""), 0, 0), glm::dvec3(-far, far, INFINITY)}) {
    EXPECT_TRUE(std::isnan(at(map, place, {0, 0, 1})));
  }
  EXPECT_FALSE(std::isnan(at(map, {0.5, 0.5, 0}, {0, 0, 1})));
  EXPECT_FALSE(std::isnan(at(map, {0.5, 0.5, 0}, {0, 0, 0}))) << "no normal: any surface";
}

TEST_F(Brick, CloudsMergeAsIfTheyWereOne) {
  std::vector<Point> points =
      sphere(20000, [](const glm::vec3& p) { return 0.5f + 0.5f * p.x * p.y; });
  const std::string whole = cloud("whole.ply", points);
  const std::vector<Point> first(points.begin(), points.begin() + 7000);
  const std::vector<Point> second(points.begin() + 7000, points.end());
  brick({whole}, "whole.vdb");
  brick({cloud("second.ply", second), cloud("first.ply", first)}, "merged.vdb");
  EXPECT_EQ(contents("whole.vdb"), contents("merged.vdb"));
  std::shuffle(points.begin(), points.end(), std::mt19937(1));
  options_.threads = 3;
  brick({cloud("shuffled.ply", points)}, "shuffled.vdb");
  EXPECT_EQ(contents("whole.vdb"), contents("shuffled.vdb"));
}

TEST_F(Brick, MemoryIsBoundedAndDoesNotChangeTheFile) {
  const std::vector<Point> points =
      sphere(600000, [](const glm::vec3& p) { return 0.5f + 0.5f * std::sin(20 * p.x) * p.z; });
  const std::string input = cloud("a.ply", points);
  const BrickStats large = brick({input}, "large.vdb");
  EXPECT_EQ(large.temporary_bytes, 0u);
  options_.memory_bytes = std::uint64_t{64} << 20;
  const BrickStats small = brick({input}, "small.vdb");
  EXPECT_GT(small.temporary_bytes, 600000u * 32);
  EXPECT_EQ(contents("large.vdb"), contents("small.vdb"));
  options_.memory_bytes = std::uint64_t{63} << 20;
  EXPECT_EQ(brickClouds({input}, path("none.vdb"), options_, progress_).status().code(),
            StatusCode::kBudgetTooSmall);
}

TEST_F(Brick, LookupsGoOnWithinTheirMemory) {
  const std::vector<Point> points =
      sphere(200000, [](const glm::vec3& p) { return 0.5f + 0.5f * std::sin(20 * p.x); });
  options_.max_error = 0.001;
  brick({cloud("a.ply", points)});
  const std::uint64_t memory = std::uint64_t{2} << 20;
  const BrickMap small = open("out.vdb", memory), large = open();
  for (std::size_t i = 0; i < points.size(); i += 17) {
    const Point& p = points[i];
    EXPECT_EQ(at(small, {p.x, p.y, p.z}, {p.nx, p.ny, p.nz}),
              at(large, {p.x, p.y, p.z}, {p.nx, p.ny, p.nz}));
  }
  EXPECT_LE(small.cachedBytes() + small.directoryBytes(), memory);
  EXPECT_GT(large.cachedBytes(), memory);
  const Result<BrickMap> none = BrickMap::open(path("out.vdb"), 1 << 20);
  EXPECT_EQ(none.status().code(), StatusCode::kBudgetTooSmall);
}

TEST_F(Brick, ManyThreadsLookUpTheSame) {
  const std::vector<Point> points = sphere(50000, [](const glm::vec3& p) { return p.x * p.y; });
  brick({cloud("a.ply", points)});
  const BrickMap map = open("out.vdb", std::uint64_t{3} << 19), one = open();
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (std::size_t i = std::size_t(t); i < 20000; i += 7) {
        std::array<float, 1> a = {}, b = {};
        const Point& p = points[i];
        const glm::dvec3 place(p.x, p.y, p.z);
        const glm::vec3 normal(p.nx, p.ny, p.nz);
        const bool same =
            *map.lookup(place, normal, 0.01, &a[0]) && *one.lookup(place, normal, 0.01, &b[0]);
        wrong += same && a == b ? 0 : 1;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST_F(Brick, LookupsAreContinuousBetweenVoxelsAndLevels) {
  const std::vector<Point> points =
      square(100, 0, 1, [](float x, float y) { return x < 0.5f ? 0.2f * y : 0.9f; });
  options_.max_error = 0.05;
  brick({cloud("a.ply", points)});
  const BrickMap map = open();
  const double step = 1e-5;
  double last = at(map, {0.01, 0.37, 0.001}, {0, 0, 1});
  for (double x = 0.01 + step; x < 0.99; x += step) {
    const double next = at(map, {x, 0.37, 0.001}, {0, 0, 1});
    ASSERT_NEAR(next, last, 0.003) << x;
    last = next;
  }
  last = at(map, {0.48, 0.37, 0}, {0, 0, 1}, 1e-3);
  for (double width = 1e-3; width < 3; width *= 1.001) {
    const double next = at(map, {0.48, 0.37, 0}, {0, 0, 1}, width);
    ASSERT_NEAR(next, last, 0.003) << width;
    last = next;
  }
}

TEST_F(Brick, WideFiltersTakeTheMean) {
  const std::vector<Point> points =
      square(128, 0, 1, [](float x, float) { return int(x * 32) % 2 == 0 ? 0.0f : 1.0f; });
  brick({cloud("a.ply", points)});
  const BrickMap map = open();
  EXPECT_GT(std::abs(at(map, {0.484375, 0.5, 0}, {0, 0, 1}) - 0.5), 0.4);
  EXPECT_NEAR(at(map, {0.484375, 0.5, 0}, {0, 0, 1}, 0.25), 0.5, 0.02);
}

TEST_F(Brick, LargePointsLieAtCoarserLevels) {
  // A dense corner in a sparse square, as clouds of several cameras are
  std::vector<Point> points = square(20, 0, 1, [](float, float) { return 0.5f; });
  std::vector<Point> dense = square(100, 0, 1, [](float x, float y) { return x + y; });
  for (Point& point : dense) {
    point.x *= 0.2f;
    point.y *= 0.2f;
    point.area *= 0.04f;
  }
  points.insert(points.end(), dense.begin(), dense.end());
  brick({cloud("a.ply", points)});
  const BrickMap map = open();
  // No holes between the sparse points
  for (double x = 0.35; x < 0.95; x += 0.003) {
    EXPECT_NEAR(at(map, {x, 0.6, 0}, {0, 0, 1}), 0.5, 0.02) << x;
  }
  EXPECT_NEAR(at(map, {0.1, 0.1, 0}, {0, 0, 1}), 1, 0.06);
}

TEST_F(Brick, WhatCannotBeKeptIsTold) {
  std::vector<Point> points = square(20, 0, 1, [](float x, float) { return x; });
  points[3].value = NAN;
  points[5].area = 0;
  points[9].x = INFINITY;
  const std::string input = cloud("a.ply", points);
  options_.max_error = 0.5;
  EXPECT_EQ(brick({input}).skipped_points, 3u);
  EXPECT_THAT(progress_.text, HasSubstr("skipped 3 records (first: record 3"));
  EXPECT_THAT(progress_.text, HasSubstr("a max error of 0.5 keeps little"));
  options_.strict = true;
  EXPECT_EQ(brickClouds({input}, path("b.vdb"), options_, progress_).status().code(),
            StatusCode::kCorruption);
}

TEST_F(Brick, RefusesWhatCannotWork) {
  const std::string input = cloud("a.ply", square(20, 0, 1, [](float x, float) { return x; }));
  const auto refusal = [&](const std::vector<std::string>& inputs) {
    const Status status = brickClouds(inputs, path("b.vdb"), options_, progress_).status();
    return fmt::format("{} {}", int(status.code()), status.message());
  };
  EXPECT_THAT(refusal({cloud("empty.ply", {})}), HasSubstr("no valid point in 0 records"));
  EXPECT_THAT(refusal({path("missing.ply")}), HasSubstr("missing.ply"));
  options_.channels = {"irradiance"};
  EXPECT_THAT(refusal({input}), HasSubstr("no channel \"irradiance\"; this cloud has: "));
  options_.channels = {};
  options_.voxel_size = 1e-9;
  EXPECT_THAT(refusal({input}), HasSubstr("give larger ones"));
  options_.voxel_size = -1;
  EXPECT_THAT(refusal({input}), HasSubstr("expected more than 0"));
  EXPECT_EQ(fileCount(), 2);
}

TEST_F(Brick, EverythingAtOnePlaceIsOneVoxel) {
  const BrickStats stats = brick({cloud("a.ply", {{1, 2, 3, 0, 1, 0, 1, 0.7f}})});
  EXPECT_EQ(voxels(stats), 1u);
  EXPECT_NEAR(at(open(), {1, 2, 3}, {0, 1, 0}), 0.7, 1e-6);
}

TEST_F(Brick, CloudsWithoutSizesAndNormalsWork) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 10000\nproperty float x\n"
      "property float y\nproperty float z\nproperty float result_r\n"
      "property float result_g\nproperty float result_b\nend_header\n";
  for (int i = 0; i < 10000; ++i) {
    const double x = (i % 100) / 100.0, y = (i / 100) / 100.0;
    text += fmt::format("{} {} 0 {} {} 0.5\n", x, y, x, y);
  }
  write("a.ply", text);
  const BrickStats stats = brick({path("a.ply")});
  // Twice the spacing, within what the guess from occupied cells is good for
  EXPECT_GT(stats.voxel_size, 0.01);
  EXPECT_LT(stats.voxel_size, 0.04);
  const BrickMap map = open();
  ASSERT_EQ(map.channels().size(), 1u);
  EXPECT_EQ(map.channels()[0].name, "result");
  EXPECT_THAT(map.channels()[0].properties,
              testing::ElementsAre("result_r", "result_g", "result_b"));
  std::array<float, 3> values = {};
  for (const glm::vec3& normal : {glm::vec3(0), glm::vec3(0, 0, 1), glm::vec3(-1, 0, 0)}) {
    ASSERT_TRUE(*map.lookup({0.3, 0.6, 0}, normal, 0, &values[0]));
    EXPECT_NEAR(values[0], 0.3f, 0.02f);
    EXPECT_NEAR(values[1], 0.6f, 0.02f);
    EXPECT_NEAR(values[2], 0.5f, 1e-6f);
  }
}

// Opens and looks up whatever the file holds: it must fail or find something.
TEST_F(Brick, DamagedFilesAreRefused) {
  const std::vector<Point> points =
      square(16, 0.3f, 1, [](float x, float y) { return std::sin(9 * x) * y; });
  brick({cloud("a.ply", points)});
  const std::string whole = contents("out.vdb");
  const auto look = [&](const std::string& bytes) {
    write("bad.vdb", bytes);
    const Result<BrickMap> map = BrickMap::open(path("bad.vdb"));
    if (!map.ok()) return map.status();
    std::vector<float> values(map->valueCount());
    for (const Point& p : points) {
      const Result<bool> found = map->lookup({p.x, p.y, p.z}, {p.nx, p.ny, p.nz}, 0.1, &values[0]);
      if (!found.ok()) return found.status();
      for (const float value : values) EXPECT_TRUE(std::isfinite(value));
    }
    return Status();
  };
  ASSERT_TRUE(look(whole).ok());
  for (std::size_t size = 0; size < whole.size(); size += size < 2000 ? 7 : 211) {
    EXPECT_EQ(look(whole.substr(0, size)).code(), StatusCode::kCorruption) << size;
  }
  std::mt19937 random(2);
  int refused = 0;
  for (int i = 0; i < 1500; ++i) {
    std::string bytes = whole;
    bytes[random() % bytes.size()] ^= char(1 << random() % 8);
    const Status status = look(bytes);
    refused += status.ok() ? 0 : 1;
    if (!status.ok()) {
      EXPECT_NE(status.code(), StatusCode::kFailed) << status.message();
    }
  }
  EXPECT_GT(refused, 100);
}

TEST_F(Brick, OtherFilesAreNoBrickMaps) {
  const std::string input = cloud("a.ply", {{1, 2, 3, 0, 1, 0, 1, 0.7f}});
  EXPECT_EQ(BrickMap::open(input).status().code(), StatusCode::kCorruption);
  EXPECT_EQ(BrickMap::open(path("missing.vdb")).status().code(), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
