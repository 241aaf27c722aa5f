// Normals of bare positions that agree with their neighbours: closed surfaces face outward, open
// ones up.
#include "octree/neighbours/orientation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "index/rows/scene_rows.h"
#include "io/row_stream_test.h"
#include "io/test_directory.h"
#include "octree/neighbours/side_forest.h"
#include "surfeit/index.h"
#include "surfeit/normals.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using Toward = NormalOrientation::Toward;

TEST(SideForestTest, KnowsWhoFacesWhom) {
  std::mt19937 random(1);
  for (int round = 0; round < 50; ++round) {
    const std::size_t count = 2 + random() % 200;
    std::vector<bool> truth(count);
    for (std::size_t i = 0; i < count; ++i) truth[i] = random() % 2 == 0;
    SideForest forest(count);
    std::size_t joined = 0;
    for (int i = 0; i < 600; ++i) {
      const auto a = std::uint32_t(random() % count), b = std::uint32_t(random() % count);
      joined += a != b && forest.join(a, b, truth[a] != truth[b]) ? 1 : 0;
    }
    EXPECT_LT(joined, count);
    for (std::uint32_t i = 0; i < count; ++i) {
      const SideForest::Root root = forest.rootOf(i);
      EXPECT_EQ(root.is_opposite, truth[i] != truth[root.index]);
    }
  }
}

class OrientationTest : public DirectoryTest {
 protected:
  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }
  double gauss() { return std::normal_distribution<double>(0, 1)(random_); }

  void add(const glm::dvec3& place, const glm::dvec3& normal, double noise = 0) {
    Surfel surfel;
    surfel.position = glm::vec3(place + noise * glm::dvec3(gauss(), gauss(), gauss()));
    surfel.normal = glm::vec3(normal);
    surfels_.push_back(surfel);
  }
  // `noise` in spacings, as below.
  void addSphere(const glm::dvec3& centre, double radius, int count, double noise = 0) {
    const double spacing = radius * std::sqrt(4 * 3.14159265 / count);
    for (int i = 0; i < count; ++i) {
      const glm::dvec3 n = glm::normalize(glm::dvec3(gauss(), gauss(), gauss()));
      add(centre + radius * n, n, noise * spacing);
    }
  }
  void addBox(const glm::dvec3& low, const glm::dvec3& size, double spacing, double noise = 0) {
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const int count = int(std::lround(size[u] * size[v] / spacing / spacing));
      for (int i = 0; i < 2 * count; ++i) {
        glm::dvec3 p = low, n(0);
        p[u] += unit() * size[u], p[v] += unit() * size[v];
        n[axis] = i < count ? -1 : 1;
        if (i >= count) p[axis] += size[axis];
        add(p, n, noise * spacing);
      }
    }
  }
  void addTerrain(int count, double noise = 0) {
    for (int i = 0; i < count; ++i) {
      const double x = 4 * unit() - 8, y = 4 * unit();
      add({x, y, .3 * std::sin(4 * x) * std::cos(3 * y)},
          glm::normalize(glm::dvec3(-1.2 * std::cos(4 * x) * std::cos(3 * y),
                                    .9 * std::sin(4 * x) * std::sin(3 * y), 1)),
          noise * 4 / std::sqrt(double(count)));
    }
  }
  // A tube wound into a ring, seen from the middle from inside and outside.
  void addTorus(const glm::dvec3& centre, int count) {
    for (int i = 0; i < count; ++i) {
      const double a = 6.2831853 * unit(), b = 6.2831853 * unit();
      const glm::dvec3 out(std::cos(a), std::sin(a), 0);
      const glm::dvec3 n = std::cos(b) * out + std::sin(b) * glm::dvec3(0, 0, 1);
      add(centre + 1.5 * out + .4 * n, n);
    }
  }

  void write() {
    auto writer = SurfelWriter::create(path("cloud.ply"), {}, {.comments = {"up z"}});
    ASSERT_TRUE(writer.ok() && writer->write(surfels_).ok() && writer->finish().ok());
  }

  // The part that faces the wrong way, of those with a normal; nearly all must have one.
  double flips(const NormalsOptions& options, const std::string& name = "normals.ply") {
    Progress quiet;
    const auto stats = estimateNormals(path("cloud.ply"), path(name), options, quiet);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    const auto reader = openRowReader(path(name));
    const std::vector<std::byte> rows = readAllRows(**reader);
    std::size_t wrong = 0, with = 0;
    for (std::size_t i = 0; i < surfels_.size(); ++i) {
      const auto value = [&](const char* property) { return valueOf(**reader, rows, i, property); };
      const glm::dvec3 normal(value("nx"), value("ny"), value("nz"));
      with += normal != glm::dvec3(0) ? 1 : 0;
      wrong += glm::dot(normal, glm::dvec3(surfels_[i].normal)) < 0 ? 1 : 0;
    }
    EXPECT_GT(with, surfels_.size() * 97 / 100);
    return double(wrong) / double(with);
  }
  double flips() {
    NormalsOptions options;
    options.estimation.orientation.toward = Toward::kConsistent;
    return flips(options);
  }

  std::mt19937 random_{5};
  std::vector<Surfel> surfels_;
};

TEST_F(OrientationTest, ManyThingsFaceOutwardAndTerrainUp) {
  addSphere({0, 0, 0}, 1, 20000);
  addSphere({0, 0, 0}, .4, 5000);  // within another
  addSphere({0, 3, 0}, .05, 800);
  addBox({3, 0, 0}, {1, 2, 1}, .02);
  addTorus({8, 0, 0}, 30000);
  addTerrain(30000);
  write();
  EXPECT_LT(flips(), .0005);
}

TEST_F(OrientationTest, NoiseDoesNotMatter) {
  for (const double noise : {.1, .2}) {
    surfels_.clear();
    addSphere({0, 0, 0}, 1, 20000, noise);
    addBox({3, 0, 0}, {1, 2, 1}, .02, noise);
    addTerrain(30000, noise);
    write();
    EXPECT_LT(flips(), .005) << noise;
  }
}

TEST_F(OrientationTest, ThinPlatesHaveTwoSides) {
  for (const double thickness : {.06, .1}) {  // three and five spacings
    surfels_.clear();
    addBox({0, 0, 0}, {2, 2, thickness}, .02);
    write();
    EXPECT_LT(flips(), .01) << thickness;
  }
}

TEST_F(OrientationTest, NeitherThreadsNorMemoryNorOrderMatter) {
  addSphere({0, 0, 0}, 1, 30000, .2);
  addTerrain(30000);
  write();
  NormalsOptions options;
  options.estimation.orientation.toward = Toward::kConsistent;
  EXPECT_LT(flips(options), .005);
  options.threads = 1;
  flips(options, "alone.ply");
  EXPECT_EQ(contents("alone.ply"), contents("normals.ply"));
  options.threads = 2;
  options.memory_bytes = 80 << 20;
  flips(options, "little.ply");
  EXPECT_EQ(contents("little.ply"), contents("normals.ply"));
}

TEST_F(OrientationTest, IndexTurnsThemTheSameWay) {
  addSphere({0, 0, 0}, 1, 20000);
  addTerrain(20000);
  write();
  IndexOptions options;
  options.normals = NormalEstimation{{Toward::kConsistent, {}, {}}, false};
  Progress quiet;
  const auto stats = indexClouds({path("cloud.ply")}, path("cloud.sft"), options, quiet);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->normals_found, surfels_.size());
  const auto reader = openCloud(path("cloud.sft"), {});
  ASSERT_TRUE(reader.ok());
  const std::vector<std::byte> rows = readAllRows(**reader);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    const auto value = [&](const char* property) { return valueOf(**reader, rows, i, property); };
    const glm::dvec3 place(value("x"), value("y"), value("z"));
    const glm::dvec3 normal(value("nx"), value("ny"), value("nz"));
    const glm::dvec3 outward = place.x > -3 ? place : glm::dvec3(0, 0, 1);
    wrong += glm::dot(normal, outward) <= 0 ? 1 : 0;
  }
  EXPECT_EQ(wrong, 0u);
}

TEST_F(OrientationTest, NormalsThatAreThereDoNotMatterToTheNormalsCommand) {
  addSphere({0, 0, 0}, 1, 20000);
  write();
  NormalsOptions up, consistent;
  consistent.estimation.orientation.toward = Toward::kConsistent;
  flips(up, "up.ply");
  EXPECT_EQ(flips(consistent), 0);
  std::filesystem::rename(path("up.ply"), path("cloud.ply"));
  EXPECT_EQ(flips(consistent), 0);
}

}  // namespace
}  // namespace surfeit
