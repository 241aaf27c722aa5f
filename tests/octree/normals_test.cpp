// Normals of clouds of bare positions, beside the true ones.
#include "surfeit/normals.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "index/rows/scene_rows.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "surfeit/index.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using Toward = NormalOrientation::Toward;

class NotesOfNormals : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

class NormalsTest : public DirectoryTest {
 protected:
  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }
  double gauss() { return std::normal_distribution<double>(0, 1)(random_); }

  // Points with their number, as doubles.
  void write(const std::vector<glm::dvec3>& points, const std::string& comment = "",
             bool with_sizes = false) const {
    std::string text =
        "ply\nformat ascii 1.0\n" + comment +
        fmt::format(
            "element vertex {}\nproperty double x\nproperty double y\n"
            "property double z\nproperty int number\n{}end_header\n",
            points.size(), with_sizes ? "property float radius\nproperty float area\n" : "");
    for (std::size_t i = 0; i < points.size(); ++i) {
      text += fmt::format("{} {} {} {}{}\n", points[i].x, points[i].y, points[i].z, i,
                          with_sizes ? " .02 .0006" : "");
    }
    DirectoryTest::write("cloud.ply", text);
  }

  struct Found {
    std::vector<glm::dvec3> position, normal;
    std::vector<double> number, confidence;
  };
  Found find(const NormalsOptions& options, const std::string& name = "normals.ply") {
    const auto stats = estimateNormals(path("cloud.ply"), path(name), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    Found found;
    if (!stats.ok()) return found;
    stats_ = *stats;
    const auto reader = openRowReader(path(name));
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    const std::vector<std::byte> rows = readAllRows(**reader);
    for (std::size_t i = 0; i < (*reader)->element().count; ++i) {
      const auto value = [&](const char* property) { return valueOf(**reader, rows, i, property); };
      found.position.emplace_back(value("x"), value("y"), value("z"));
      found.normal.emplace_back(value("nx"), value("ny"), value("nz"));
      found.number.push_back(value("number"));
      found.confidence.push_back(value("normal_confidence"));
    }
    return found;
  }

  // The median angle from the true normals, in degrees; those without are 90.
  static double medianAngle(const Found& found,
                            const std::function<glm::dvec3(const glm::dvec3&)>& truth) {
    std::vector<double> angles;
    for (std::size_t i = 0; i < found.normal.size(); ++i) {
      const double cosine = glm::dot(found.normal[i], truth(found.position[i]));
      angles.push_back(std::acos(std::clamp(cosine, -1., 1.)) * 180 / 3.14159265358979);
    }
    std::nth_element(angles.begin(), angles.begin() + std::ptrdiff_t(angles.size() / 2),
                     angles.end());
    return angles[angles.size() / 2];
  }
  static double partBelow(const Found& found, double cosine,
                          const std::function<glm::dvec3(const glm::dvec3&)>& truth) {
    int below = 0;
    for (std::size_t i = 0; i < found.normal.size(); ++i) {
      below += glm::dot(found.normal[i], truth(found.position[i])) < cosine ? 1 : 0;
    }
    return double(below) / double(found.normal.size());
  }

  std::vector<glm::dvec3> sphere(int count, double noise,
                                 const glm::dvec3& centre = glm::dvec3(0)) {
    std::vector<glm::dvec3> points;
    const double spacing = std::sqrt(4 * 3.14159265 / count);
    for (int i = 0; i < count; ++i) {
      const glm::dvec3 direction = glm::normalize(glm::dvec3(gauss(), gauss(), gauss()));
      points.push_back(centre + direction * (1 + noise * spacing * gauss()));
    }
    return points;
  }

  std::mt19937 random_{3};
  NotesOfNormals notes_;
  NormalsStats stats_;
};

TEST_F(NormalsTest, SpheresGetTheirsWithAndWithoutNoise) {
  NormalsOptions outward;
  outward.estimation.orientation.toward = Toward::kOutward;
  const auto truth = [](const glm::dvec3& p) { return glm::normalize(p); };
  write(sphere(20000, 0));
  const Found clean = find(outward);
  EXPECT_LT(medianAngle(clean, truth), 1);
  EXPECT_EQ(partBelow(clean, 0, truth), 0);
  EXPECT_EQ(stats_.without, 0u);
  EXPECT_GT(stats_.mean_confidence, .98);
  write(sphere(20000, .2));
  const Found noisy = find(outward);
  EXPECT_LT(medianAngle(noisy, truth), 5);
  EXPECT_LT(partBelow(noisy, 0, truth), .005);
}

TEST_F(NormalsTest, RowsKeepTheirOrderAndAllThatTheyHave) {
  std::vector<glm::dvec3> points = sphere(5000, 0, {500000, 5000000, 100});
  write(points);
  NormalsOptions outward;
  outward.estimation.orientation.toward = Toward::kOutward;
  const Found found = find(outward);
  ASSERT_EQ(found.number.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(found.number[i], double(i));
    EXPECT_EQ(found.position[i], points[i]);
  }
  EXPECT_LT(medianAngle(found,
                        [](const glm::dvec3& p) {
                          return glm::normalize(p - glm::dvec3(500000, 5000000, 100));
                        }),
            2);
  // Whatever the order, the threads and the budget
  const Found alone = [&] {
    NormalsOptions options = outward;
    options.threads = 1;
    return find(options, "alone.ply");
  }();
  EXPECT_EQ(contents("alone.ply"), contents("normals.ply"));
  std::vector<std::size_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), random_);
  std::vector<glm::dvec3> shuffled;
  for (const std::size_t i : order) shuffled.push_back(points[i]);
  write(shuffled);
  const Found other = find(outward);
  for (std::size_t i = 0; i < order.size(); ++i) EXPECT_EQ(other.normal[i], found.normal[order[i]]);
}

TEST_F(NormalsTest, TerrainFacesUpWhateverUpIs) {
  const auto heights = [](double x, double y) { return .1 * std::sin(7 * x) * std::cos(5 * y); };
  std::vector<glm::dvec3> points;
  for (int i = 0; i < 10000; ++i) {
    const double x = unit(), y = unit();
    points.emplace_back(x, y, heights(x, y));
  }
  write(points, "comment up z\n");
  EXPECT_EQ(partBelow(find({}), 0, [](const glm::dvec3&) { return glm::dvec3(0, 0, 1); }), 0);
  NormalsOptions y_up;
  y_up.up = UpAxis::kY;
  EXPECT_EQ(partBelow(find(y_up), 0, [](const glm::dvec3&) { return glm::dvec3(0, 1, 0); }), 0);
}

TEST_F(NormalsTest, RoomsFaceTheirSensor) {
  std::vector<glm::dvec3> points;
  for (int i = 0; i < 12000; ++i) {
    glm::dvec3 p(unit(), unit(), unit());
    p[i % 3] = i % 2;
    points.push_back(p + glm::dvec3(1000, 0, 0));
  }
  write(points);
  NormalsOptions options;
  options.estimation.orientation = {Toward::kSensor, {1000.3, .6, .4}, {}};
  const glm::dvec3 sensor = options.estimation.orientation.sensor;
  const Found found = find(options);
  for (std::size_t i = 0; i < found.normal.size(); ++i) {
    EXPECT_GE(glm::dot(found.normal[i], sensor - found.position[i]), -1e-4);
  }
}

// A corridor along x, driven through: its walls, floor and ceiling face the middle.
TEST_F(NormalsTest, CorridorsFaceWhereTheSensorWasAtTheirTime) {
  std::string text = "x,y,z,t\n", trajectory = "t,x,y,z\n";
  std::vector<glm::dvec3> inward;
  for (int i = 0; i < 20000; ++i) {
    const double x = 40 * unit();
    const int side = i % 4;
    const double along = 2 * unit() - 1, far = side % 2 == 0 ? -1 : 1;
    const glm::dvec3 p = side < 2 ? glm::dvec3(x, along, far) : glm::dvec3(x, far, along);
    text += fmt::format("{},{},{},{}\n", p.x, p.y, p.z, 1000 + x / 2 + unit());
    inward.push_back(side < 2 ? glm::dvec3(0, 0, -far) : glm::dvec3(0, -far, 0));
  }
  for (int i = 21; i >= 0; --i) trajectory += fmt::format("{},{},0,0\n", 1000 + i, 2 * i);
  DirectoryTest::write("corridor.csv", text);
  DirectoryTest::write("trajectory.csv", trajectory);
  NormalsOptions options;
  options.channels = "t=gps_time";
  options.estimation.orientation = {Toward::kTrajectory, {}, path("trajectory.csv")};
  const auto stats = estimateNormals(path("corridor.csv"), path("normals.ply"), options, notes_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->outside_trajectory, 0u);
  const auto reader = openRowReader(path("normals.ply"));
  const std::vector<std::byte> rows = readAllRows(**reader);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < inward.size(); ++i) {
    const auto value = [&](const char* property) { return valueOf(**reader, rows, i, property); };
    const glm::dvec3 normal(value("nx"), value("ny"), value("nz"));
    wrong += glm::dot(normal, inward[i]) < 0 ? 1 : 0;
  }
  EXPECT_LT(wrong, inward.size() / 200);  // a few at the edges of the corridor

  // Times outside, no times, no trajectory
  DirectoryTest::write("trajectory.csv", "t,x,y,z\n1005,10,0,0\n1008,16,0,0\n");
  const auto outside = estimateNormals(path("corridor.csv"), path("normals.ply"), options, notes_);
  ASSERT_TRUE(outside.ok()) << outside.status().message();
  EXPECT_GT(outside->outside_trajectory, 10000u);
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("before or after the trajectory")));
  options.channels.clear();
  EXPECT_EQ(estimateNormals(path("corridor.csv"), path("a.ply"), options, notes_).status().code(),
            StatusCode::kInvalidArgument);
  options.channels = "t=gps_time";
  options.estimation.orientation.trajectory = path("corridor.csv");
  DirectoryTest::write("trajectory.csv", "x,y,z\n1,2,3\n");
  options.estimation.orientation.trajectory = path("trajectory.csv");
  EXPECT_EQ(estimateNormals(path("corridor.csv"), path("a.ply"), options, notes_).status().code(),
            StatusCode::kCorruption);
  IndexOptions indexing;
  indexing.normals = options.estimation;
  EXPECT_EQ(indexClouds({path("corridor.csv")}, path("a.sft"), indexing, notes_).status().code(),
            StatusCode::kInvalidArgument);
}

TEST_F(NormalsTest, PointsAllAroundHaveNoneOrAreTwoSided) {
  std::vector<glm::dvec3> points;
  for (int i = 0; i < 5000; ++i) points.emplace_back(unit(), unit(), unit());
  write(points);
  Found found = find({});
  const auto none = std::count(found.normal.begin(), found.normal.end(), glm::dvec3(0));
  EXPECT_GT(none, 3750);  // all but those at the faces of the cube
  EXPECT_EQ(stats_.without, std::uint64_t(none));
  NormalsOptions options;
  options.estimation.thin_is_two_sided = true;
  found = find(options);
  EXPECT_EQ(std::count(found.normal.begin(), found.normal.end(), glm::dvec3(0)), 0);
  const auto reader = openRowReader(path("normals.ply"));
  EXPECT_NE((*reader)->element().find("two_sided"), nullptr);
}

TEST_F(NormalsTest, SizesAreThoseOfTheSurface) {
  write(sphere(20000, 0));
  NormalsOptions options;
  options.with_sizes = true;
  find(options);
  const auto reader = openRowReader(path("normals.ply"));
  const std::vector<std::byte> rows = readAllRows(**reader);
  double area = 0;
  for (std::size_t i = 0; i < 20000; ++i) area += valueOf(**reader, rows, i, "area");
  EXPECT_NEAR(area, 4 * 3.14159265, .05);
}

// Areas of cells lead to the disks of a cloud without sizes.
TEST_F(NormalsTest, IndexMakesTheSameDisksOfSizesThatAreWritten) {
  write(sphere(20000, 0));
  NormalsOptions options;
  options.with_sizes = true;
  options.estimation.orientation.toward = Toward::kOutward;
  find(options);
  IndexOptions indexing;
  indexing.full_precision = true;
  std::vector<std::vector<double>> radii(20000);
  for (const char* channels : {"normal_confidence=-", "area=-"}) {
    indexing.channels = channels;
    const auto stats = indexClouds({path("normals.ply")}, path("cloud.sft"), indexing, notes_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    const auto reader = openCloud(path("cloud.sft"), {});
    ASSERT_TRUE(reader.ok());
    const std::vector<std::byte> rows = readAllRows(**reader);
    for (std::size_t i = 0; i < 20000; ++i) {
      radii[i].push_back(valueOf(**reader, rows, i, "radius"));
    }
  }
  const auto differing = std::count_if(radii.begin(), radii.end(), [](const auto& both) {
    return std::abs(both[0] - both[1]) > .03 * both[1];
  });
  EXPECT_LT(differing, 10);
}

std::array<long, 3> rounded(const glm::dvec3& p) {
  return {std::lround(p.x * 1e5), std::lround(p.y * 1e5), std::lround(p.z * 1e5)};
}

// The scene's normals by rounded position.
std::map<std::array<long, 3>, glm::dvec3> normalsOfScene(const std::string& path) {
  const auto reader = openCloud(path, {});
  EXPECT_TRUE(reader.ok()) << reader.status().message();
  const std::vector<std::byte> rows = readAllRows(**reader);
  std::map<std::array<long, 3>, glm::dvec3> normals;
  for (std::size_t i = 0; i < (*reader)->element().count; ++i) {
    const auto value = [&](const char* property) { return valueOf(**reader, rows, i, property); };
    normals[rounded({value("x"), value("y"), value("z")})] = {value("nx"), value("ny"),
                                                              value("nz")};
  }
  return normals;
}

TEST_F(NormalsTest, IndexFindsTheSame) {
  std::vector<glm::dvec3> points = sphere(5000, .1);
  for (int i = 0; i < 1000; ++i) points.emplace_back(4 + unit(), unit(), unit());
  write(points, "", /* with_sizes= */ true);  // they keep their places
  for (const bool is_two_sided : {false, true}) {
    NormalsOptions options;
    options.estimation = {{Toward::kOutward, {}, {}}, is_two_sided};
    const Found found = find(options);
    IndexOptions indexing;
    indexing.full_precision = true;
    indexing.normals = options.estimation;
    const auto stats = indexClouds({path("cloud.ply")}, path("cloud.sft"), indexing, notes_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_EQ(stats->thin_surfels, stats_.without);
    EXPECT_EQ(stats->normals_found + stats->thin_surfels, points.size());
    const auto normals = normalsOfScene(path("cloud.sft"));
    std::size_t different = 0, compared = 0;
    for (std::size_t i = 0; i < found.normal.size(); ++i) {
      const auto at = normals.find(rounded(found.position[i]));
      if (at == normals.end()) continue;  // rounded the other way
      ++compared;
      different += glm::length(at->second - found.normal[i]) > 1e-5 ? 1 : 0;
    }
    EXPECT_EQ(different, 0u);
    EXPECT_GT(compared, points.size() * 9 / 10);
  }
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("it follows from their neighbours")));
}

TEST_F(NormalsTest, IndexLeavesNormalsAloneThatAreThere) {
  write(sphere(2000, 0));
  find({});  // up, which is wrong for half of them
  IndexOptions indexing;
  indexing.normals = NormalEstimation{{Toward::kOutward, {}, {}}, false};
  const auto stats = indexClouds({path("normals.ply")}, path("cloud.sft"), indexing, notes_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->normals_found, 0u);
}

TEST_F(NormalsTest, WhatCannotBeDoneIsSaid) {
  write(sphere(1000, 0));
  NormalsOptions options;
  options.memory_bytes = 1 << 20;
  EXPECT_EQ(estimateNormals(path("cloud.ply"), path("a.ply"), options, notes_).status().code(),
            StatusCode::kBudgetTooSmall);
  options.memory_bytes = 0;
  options.estimation.orientation = {Toward::kSensor, {NAN, 0, 0}, {}};
  EXPECT_EQ(estimateNormals(path("cloud.ply"), path("a.ply"), options, notes_).status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(estimateNormals(path("gone.ply"), path("a.ply"), {}, notes_).status().code(),
            StatusCode::kIoError);
  EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
  // Normals that are there are replaced
  find({}, "cloud2.ply");
  std::filesystem::rename(path("cloud2.ply"), path("cloud.ply"));
  find({});
  EXPECT_THAT(notes_.notes, Contains(HasSubstr("nx is replaced")));
}

}  // namespace
}  // namespace surfeit
