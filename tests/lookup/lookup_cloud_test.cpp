// Baked values looked up at receivers: against linear fields, and against all points one by one.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <vector>

#include "io/test_directory.h"
#include "surfeit/brick.h"
#include "surfeit/cloud_rows.h"
#include "surfeit/lookup.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

// A record of the clouds of these tests.
struct Baked {
  glm::vec3 position{0}, normal{0};
  float occlusion = 0;
  glm::vec3 bent{0};
};
constexpr std::array<const char*, 10> kBakedNames = {"x",
                                                     "y",
                                                     "z",
                                                     "nx",
                                                     "ny",
                                                     "nz",
                                                     "occlusion",
                                                     "bent_normal_x",
                                                     "bent_normal_y",
                                                     "bent_normal_z"};

// Keeps what is told.
class Notes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

float linearField(const glm::vec3& p) { return 0.2f + 0.3f * p.x + 0.5f * p.y - 0.1f * p.z; }
const double kGradient = std::sqrt(0.09 + 0.25 + 0.01);

class Lookup : public DirectoryTest {
 protected:
  std::string cloud(const std::string& name, const std::vector<Baked>& points,
                    std::size_t columns = 10) const {
    std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                       std::to_string(points.size()) + "\n";
    for (std::size_t i = 0; i < columns; ++i)
      text += fmt::format("property float {}\n", kBakedNames[i]);
    text += "end_header\n";
    for (const Baked& point : points) {
      text.append(reinterpret_cast<const char*>(&point), columns * sizeof(float));
    }
    write(name, text);
    return path(name);
  }

  // n x n points of the unit square at height z.
  static std::vector<Baked> square(int n, float z, float nz, float shift = 0.5f) {
    std::vector<Baked> points;
    for (int i = 0; i < n * n; ++i) {
      Baked point;
      point.position = {(float(i / n) + shift) / float(n), (float(i % n) + shift) / float(n), z};
      point.normal = {0, 0, nz};
      point.occlusion = linearField(point.position);
      point.bent = {1, 0, 0};
      points.push_back(point);
    }
    return points;
  }

  // Random points of a sphere and of a smaller one within it that faces inward.
  static std::vector<Baked> shells(int n, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<Baked> points;
    for (int i = 0; i < n; ++i) {
      const glm::vec3 p = glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
      const bool is_inner = i % 3 == 0;
      Baked point;
      point.position = is_inner ? 0.97f * p : p;
      point.normal = is_inner ? -p : p;
      point.occlusion = is_inner ? 10 + p.x : p.y;
      points.push_back(point);
    }
    return points;
  }

  LookupStats lookup(const std::string& map, const std::string& receivers,
                     const std::string& result = "out.ply") {
    const Result<LookupStats> stats =
        lookupCloud(map, receivers, path(result), options_, progress_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? *stats : LookupStats();
  }

  std::vector<float> column(const std::string& file, const std::string& name) const {
    Result<CloudInput> input = CloudInput::open(path(file));
    EXPECT_TRUE(input.ok()) << input.status().message();
    std::vector<float> values(static_cast<std::size_t>(input->count()));
    std::vector<ColumnTarget> targets(input->columns().size());
    bool is_there = false;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      if (input->columns()[i].name != name) continue;
      EXPECT_EQ(input->columns()[i].type, ColumnType::kFloat32);
      targets[i] = {values.data(), sizeof(float)};
      is_there = true;
    }
    EXPECT_TRUE(is_there) << name;
    EXPECT_EQ(*input->read(values.size(), targets.data()), values.size());
    return values;
  }

  double largestError(const std::vector<Baked>& receivers,
                      const std::function<double(const Baked&)>& truth) const {
    const std::vector<float> found = column("out.ply", "occlusion");
    double largest = 0;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      EXPECT_TRUE(std::isfinite(found[i])) << i;
      largest = std::max(largest, std::abs(double(found[i]) - truth(receivers[i])));
    }
    return largest;
  }

  std::string refusal(const std::string& map, const std::string& receivers) {
    const Result<LookupStats> stats =
        lookupCloud(map, receivers, path("refused.ply"), options_, progress_);
    EXPECT_FALSE(stats.ok());
    EXPECT_EQ(contents("refused.ply"), "");
    return stats.status().message();
  }

  LookupOptions options_;
  Notes progress_;
};

double fieldAt(const Baked& receiver) { return double(linearField(receiver.position)); }

// The nearest point of a square grid is half a diagonal away at most.
TEST_F(Lookup, NearestFindsALinearFieldWithinTheGridsSpacing) {
  const std::string map = cloud("map.ply", square(40, 0, 1));
  const std::vector<Baked> receivers = square(97, 0, 1, 0.3f);
  options_.interpolation = LookupInterpolation::kNearest;
  const LookupStats stats = lookup(map, cloud("receivers.ply", receivers, 6));
  EXPECT_EQ(stats.receivers, 97u * 97u);
  EXPECT_EQ(stats.missing_receivers, 0u);
  EXPECT_EQ(stats.points, 1600u);
  EXPECT_FALSE(stats.is_brick_map);
  const double error = largestError(receivers, fieldAt);
  EXPECT_LE(error, 0.5 / 40 * (0.3 + 0.5) + 1e-6);
  EXPECT_GE(error, 0.8 * 0.5 / 40 * (0.3 + 0.5));  // and it is no better than that
}

// The weights end at the ninth point, two spacings away at most in the middle, and 2 sqrt(2) at a
// corner, where all points lie on one side.
TEST_F(Lookup, SmoothFindsALinearFieldCloserInTheMiddle) {
  const std::string map = cloud("map.ply", square(40, 0, 1));
  std::vector<Baked> receivers = square(97, 0, 1, 0.3f);
  lookup(map, cloud("receivers.ply", receivers, 6));
  EXPECT_LE(largestError(receivers, fieldAt), kGradient * 2 * std::sqrt(2.0) / 40);
  std::erase_if(receivers, [](const Baked& r) {
    return std::min({r.position.x, r.position.y, 1 - r.position.x, 1 - r.position.y}) < 0.06f;
  });
  lookup(map, cloud("middle.ply", receivers, 6));
  EXPECT_LE(largestError(receivers, fieldAt), 0.2 * kGradient / 40);
}

// A value is a mean over voxels no more than one away along each axis: those beside the border of
// the square lie half a voxel within it.
TEST_F(Lookup, BrickMapsFindALinearFieldWithinTheirVoxels) {
  BrickOptions bricking;
  bricking.max_error = 0;
  const Result<BrickStats> brick =
      brickClouds({cloud("map.ply", square(40, 0, 1))}, path("map.vdb"), bricking, progress_);
  ASSERT_TRUE(brick.ok()) << brick.status().message();
  const std::vector<Baked> receivers = square(97, 0, 1, 0.3f);
  const LookupStats stats = lookup(path("map.vdb"), cloud("receivers.ply", receivers, 6));
  EXPECT_TRUE(stats.is_brick_map);
  EXPECT_EQ(stats.missing_receivers, 0u);
  EXPECT_LE(largestError(receivers, fieldAt), brick->voxel_size * (0.3 + 0.5));

  // The same as by hand
  const Result<BrickMap> opened = BrickMap::open(path("map.vdb"));
  ASSERT_TRUE(opened.ok());
  const std::vector<float> found = column("out.ply", "occlusion");
  for (std::size_t i = 0; i < receivers.size(); i += 501) {
    std::vector<float> values(opened->valueCount());
    ASSERT_TRUE(*opened->lookup(glm::dvec3(receivers[i].position), {0, 0, 1}, 0, values.data()));
    EXPECT_EQ(found[i], values[0]);
  }
}

// Of all points, one by one: those that face the same way, and the ninth ends the weights.
float bruteForce(const std::vector<Baked>& points, const Baked& at, std::size_t wanted) {
  std::vector<std::pair<double, float>> near;
  for (const Baked& point : points) {
    if (glm::dot(point.normal, at.normal) < 0.5f) continue;
    near.emplace_back(glm::length(glm::dvec3(point.position) - glm::dvec3(at.position)),
                      point.occlusion);
  }
  std::sort(near.begin(), near.end());
  if (wanted == 1) return near[0].second;
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    const double weight = std::pow(1 - near[i].first / near[8].first, 2);
    sum += weight * double(near[i].second);
    weights += weight;
  }
  return float(sum / weights);
}

TEST_F(Lookup, SearchesAgreeWithAllPointsOneByOne) {
  const std::vector<Baked> points = shells(6000, 3), receivers = shells(300, 4);
  const std::string map = cloud("map.ply", points), at = cloud("receivers.ply", receivers, 6);
  for (const std::size_t wanted : {1, 8}) {
    options_.interpolation =
        wanted == 1 ? LookupInterpolation::kNearest : LookupInterpolation::kSmooth;
    lookup(map, at);
    const std::vector<float> found = column("out.ply", "occlusion");
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      EXPECT_NEAR(found[i], bruteForce(points, receivers[i], wanted), 2e-5) << i;
    }
  }
}

// Points in any order, any number of threads and any budget give the same bytes, though the least
// budget holds a part of the cloud alone.
TEST_F(Lookup, CloudsLargerThanTheBudgetGiveTheSame) {
  std::vector<Baked> points = shells(600000, 5);
  const std::string map = cloud("map.ply", points);
  const std::string at = cloud("receivers.ply", shells(60000, 6), 6);
  options_.threads = 1;
  const LookupStats all = lookup(map, at, "all.ply");
  options_.memory_bytes = std::uint64_t{30} << 20;
  std::shuffle(points.begin(), points.end(), std::mt19937(7));
  options_.threads = 2;
  const LookupStats part = lookup(cloud("shuffled.ply", points), at, "part.ply");
  EXPECT_EQ(contents("all.ply"), contents("part.ply"));
  const std::uint64_t pages = (points.size() + 511) / 512;
  EXPECT_LE(all.page_loads, pages);
  EXPECT_GT(part.page_loads, pages);               // some were read again
  EXPECT_GT(part.temporary_bytes, 30000000u * 2);  // the sort spilled, too
  EXPECT_EQ(part.memory_bytes, options_.memory_bytes);
}

// An object that has moved finds what was baked where it stood, and directions turn along.
TEST_F(Lookup, MovedObjectsFindTheirValuesAgain) {
  const std::vector<Baked> still = square(50, 0, 1, 0.4f);
  const std::string map = cloud("map.ply", square(40, 0, 1));
  lookup(map, cloud("still.ply", still, 6));
  const std::vector<float> expected = column("out.ply", "occlusion");

  // Turned by 90 degrees about z, scaled by 2 and moved: x' = 10 - 2 y, y' = 2 x, z' = 5 + 2 z
  const LookupMatrix moved = {0, -2, 0, 10, 2, 0, 0, 0, 0, 0, 2, 5};
  const auto move = [](const std::vector<Baked>& points) {
    std::vector<Baked> there = points;
    for (Baked& point : there) {
      const glm::vec3 p = point.position;
      point.position = {10 - 2 * p.y, 2 * p.x, 5 + 2 * p.z};
      point.bent = {-point.bent.y, point.bent.x, point.bent.z};
    }
    return there;
  };
  options_.from_space = moved;
  lookup(map, cloud("moved.ply", move(still), 6));
  const std::vector<float> found = column("out.ply", "occlusion");
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 2e-5) << i;
  EXPECT_NEAR(column("out.ply", "bent_normal_x")[7], 0, 1e-6);
  EXPECT_NEAR(column("out.ply", "bent_normal_y")[7], 1, 1e-6);

  // Baked there, looked up here; and where both stand there nothing is moved
  options_.from_space = kIdentityMatrix;
  options_.to_space = moved;
  const std::string moved_map = cloud("moved_map.ply", move(square(40, 0, 1)));
  lookup(moved_map, path("still.ply"));
  const std::vector<float> back = column("out.ply", "occlusion");
  for (std::size_t i = 0; i < back.size(); ++i) EXPECT_NEAR(back[i], expected[i], 2e-5) << i;
  EXPECT_NEAR(column("out.ply", "bent_normal_x")[7], 1, 1e-6);
  options_.from_space = moved;
  lookup(moved_map, path("moved.ply"));
  EXPECT_NEAR(column("out.ply", "bent_normal_y")[7], 1, 1e-6);

  options_.to_space = kIdentityMatrix;
  options_.from_space = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  EXPECT_THAT(refusal(map, path("still.ply")), HasSubstr("from-space: the matrix has no inverse"));
}

// A sheet that was bent up is looked up where it lay.
TEST_F(Lookup, ReferencePositionsFindValuesOnWhatDeforms) {
  std::string text = "x y z nx ny nz Pref_x Pref_y Pref_z Nref_x Nref_y Nref_z\n";
  const std::vector<Baked> flat = square(20, 0, 1, 0.4f);
  for (const Baked& p : flat) {
    text += fmt::format("{} 7 {} 1 0 0 {} {} 0 0 0 1\n", p.position.y, p.position.x * 3,
                        p.position.x, p.position.y);
  }
  write("bent.txt", text);
  const std::string map = cloud("map.ply", square(40, 0, 1));
  lookup(map, cloud("flat.ply", flat, 6));
  const std::vector<float> expected = column("out.ply", "occlusion");

  options_.reference_positions = "Pref";
  progress_.notes.clear();
  lookup(map, path("bent.txt"));
  EXPECT_THAT(fmt::format("{}", progress_.notes.at(0)), HasSubstr("--nref"));
  const std::vector<float> found = column("out.ply", "occlusion");
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-5) << i;
  options_.reference_normals = "Nref";
  progress_.notes.clear();
  lookup(map, path("bent.txt"));
  EXPECT_THAT(progress_.notes, IsEmpty());
  EXPECT_EQ(column("out.ply", "occlusion"), found);

  // Without them nothing is there
  options_.reference_positions = options_.reference_normals = "";
  EXPECT_EQ(lookup(map, path("bent.txt")).missing_receivers, 400u);
  options_.reference_positions = "rest";
  EXPECT_THAT(refusal(map, path("bent.txt")), HasSubstr("expected rest_x rest_y rest_z"));
}

// The other side of a sheet, places far off and places that are none have no value; each is told
// once.
TEST_F(Lookup, WhatFindsNothingIsToldOnce) {
  std::vector<Baked> receivers = square(3, 0, 1);
  receivers[1].normal.z = -1;
  receivers[2].position.z = 3;
  receivers[3].position.x = std::nanf("");
  const std::string at = cloud("receivers.ply", receivers, 6);
  const std::string map = cloud("map.ply", square(40, 0, 1));
  const LookupStats stats = lookup(map, at);
  EXPECT_EQ(stats.receivers, 9u);
  EXPECT_EQ(stats.missing_receivers, 2u);
  EXPECT_EQ(stats.invalid_receivers, 1u);
  ASSERT_EQ(progress_.notes.size(), 2u);
  EXPECT_THAT(progress_.notes[1], HasSubstr("2 of 9 receivers find no value nearby"));
  std::vector<float> found = column("out.ply", "occlusion");
  for (const std::size_t i : {1, 2, 3}) EXPECT_TRUE(std::isnan(found[i])) << i;
  EXPECT_NEAR(found[0], double(linearField(receivers[0].position)), 0.05);
  options_.missing = -1;
  options_.max_distance = 4;
  EXPECT_EQ(lookup(map, at).missing_receivers, 1u);
  found = column("out.ply", "occlusion");
  EXPECT_EQ(found[1], -1);
  EXPECT_NEAR(found[2], double(linearField(receivers[2].position)), 0.4);
  options_.strict = true;
  EXPECT_THAT(refusal(map, at), HasSubstr("record 3"));
}

TEST_F(Lookup, ChannelsAreChosenAndReplaced) {
  const std::string map = cloud("map.ply", square(40, 0, 1));
  std::vector<Baked> receivers = square(20, 0, 1);
  for (Baked& receiver : receivers) receiver.occlusion = 77;
  options_.values = {"occlusion"};
  const LookupStats stats = lookup(map, cloud("receivers.ply", receivers));
  EXPECT_EQ(stats.channels, std::vector<std::string>{"occlusion"});
  EXPECT_LT(column("out.ply", "occlusion")[5], 2);
  EXPECT_EQ(column("out.ply", "bent_normal_x")[5], 1);  // the receivers' own
  options_.values = {"bent_normal_y"};
  lookup(map, path("receivers.ply"));
  EXPECT_EQ(column("out.ply", "occlusion")[5], 77);
  EXPECT_EQ(column("out.ply", "bent_normal_y")[5], 0);
  options_.values = {"irradiance"};
  EXPECT_THAT(refusal(map, path("receivers.ply")), HasSubstr("this cloud has: position, normal"));
}

// Many points at one place, one point, and points on a line.
TEST_F(Lookup, DegenerateCloudsAreLookedUp) {
  const std::string at = cloud("receivers.ply", square(4, 0, 1), 6);
  Baked point;
  point.normal = {0, 0, 1};
  point.occlusion = 0.25f;
  for (const int count : {1, 5000}) {
    lookup(cloud("same.ply", std::vector<Baked>(static_cast<std::size_t>(count), point)), at);
    for (const float found : column("out.ply", "occlusion")) EXPECT_EQ(found, 0.25f);
  }
  std::vector<Baked> line;
  for (int i = 0; i < 2000; ++i) {
    point.position.x = float(i) / 2000;
    line.push_back(point);
  }
  options_.max_distance = 2;
  EXPECT_EQ(lookup(cloud("line.ply", line), at).missing_receivers, 0u);
  for (const float found : column("out.ply", "occlusion")) EXPECT_FLOAT_EQ(found, 0.25f);
}

TEST_F(Lookup, SmallBudgetsNameTheLeastThatWorks) {
  const std::string map = cloud("map.ply", square(20, 0, 1));
  const std::string at = cloud("receivers.ply", square(4, 0, 1), 6);
  options_.memory_bytes = 8 << 20;
  EXPECT_THAT(refusal(map, at), HasSubstr("MiB is the least that works"));
}

}  // namespace
}  // namespace surfeit
