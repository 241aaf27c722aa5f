// Clouds on a map or a globe: what is gathered there is what is gathered about 0.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "gather/test_scene.h"
#include "index/rows/scene_rows.h"
#include "octree/test_scenes.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/cube.h"
#include "surfeit/radiance.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr CloudChannels kLitChannels = {
    .normal = true, .radius = true, .area = true, .radiosity = true, .albedo = true};

// A floor before a wall, ten units wide, in millimetres as scans are; half of it emits.
std::vector<Surfel> roomCorner() {
  TestRandom random(11);
  std::vector<Surfel> cloud;
  for (int i = 0; i < 6000; ++i) {
    const bool is_floor = i % 3 != 0;
    const glm::vec2 at = glm::round(glm::vec2(random.unit(), random.unit()) * 1e4f) * 1e-3f;
    Surfel surfel;
    surfel.position = is_floor ? glm::vec3(at, 0) : glm::vec3(at.x, 10, at.y * 0.4f);
    surfel.normal = is_floor ? glm::vec3(0, 0, 1) : glm::vec3(0, -1, 0);
    surfel.area = 0.035f;
    surfel.radius = 0.15f;
    surfel.albedo = glm::vec3(0.6f);
    surfel.radiosity = is_floor ? glm::vec3(0) : glm::vec3(1, 0.5f, surfel.position.z);
    cloud.push_back(surfel);
  }
  return cloud;
}

class MovedCloudTest : public DirectoryTest, public testing::WithParamInterface<glm::dvec3> {
 protected:
  // The cloud about 0 and at its place, as local.ply and moved.ply, and scenes of both.
  void SetUp() override {
    DirectoryTest::SetUp();
    for (const std::string name : {"local", "moved"}) {
      const glm::dvec3 origin = name == "local" ? glm::dvec3(0) : GetParam();
      Result<SurfelWriter> writer =
          SurfelWriter::create(path(name + ".ply"), kLitChannels, {}, origin);
      ASSERT_TRUE(writer.ok());
      ASSERT_TRUE(writer->write(roomCorner()).ok());
      ASSERT_TRUE(writer->finish().ok());
      IndexOptions options;
      options.threads = 1;
      const auto indexed =
          indexClouds({path(name + ".ply")}, path(name + ".sft"), options, progress_);
      ASSERT_TRUE(indexed.ok()) << indexed.status().message();
    }
  }

  SceneHeader headerOf(const std::string& name) {
    const Result<SceneFile> scene = SceneFile::open(path(name + ".sft"));
    return scene.ok() ? scene->header() : SceneHeader();
  }

  // A property of all rows.
  static std::vector<double> values(RowReader& reader, const std::string& property) {
    const RowProperty* const field = reader.element().find(property);
    std::vector<double> values;
    AlignedBuffer buffer;
    for (;;) {
      const Result<Bytes> rows = reader.readRows(4096, buffer);
      if (field == nullptr || !rows.ok() || rows->empty()) return values;
      for (std::size_t at = 0; at < rows->size(); at += reader.element().row_bytes) {
        values.push_back(rowValue(rows->data() + at + field->offset, field->type));
      }
    }
  }
  std::vector<double> valuesOf(const std::string& file, const std::string& property) {
    const Result<std::unique_ptr<RowReader>> reader = openCloud(path(file));
    return reader.ok() ? values(**reader, property) : std::vector<double>();
  }

  void expectSame(const std::string& local, const std::string& moved, const std::string& property,
                  double limit) {
    const std::vector<double> a = valuesOf(local, property), b = valuesOf(moved, property);
    ASSERT_EQ(a.size(), b.size());
    ASSERT_FALSE(a.empty()) << property;
    double worst = 0, mean = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      worst = std::max(worst, std::abs(a[i] - b[i]));
      mean += a[i] / double(a.size());
    }
    EXPECT_GT(mean, 0.01) << property;
    EXPECT_LE(worst, limit) << property << ", mean " << mean;
  }

  void gatherBoth(const GatherOptions& options, const std::string& result) {
    for (const std::string name : {"local", "moved"}) {
      GatherOptions own = options;
      own.threads = 1;
      if (name == "moved") own.eye += GetParam();
      const auto gathered = gatherCloud(path(name + ".sft"), path(name + ".ply"),
                                        path(name + result), own, progress_);
      ASSERT_TRUE(gathered.ok()) << gathered.status().message();
    }
  }

  // Gathers may differ by rounding of doubles far from 0, and by nothing else.
  static constexpr double kLimit = 2e-5;
  Progress progress_;
};

TEST_P(MovedCloudTest, HasTheSamePagesAboutAnOrigin) {
  const SceneHeader local = headerOf("local"), moved = headerOf("moved");
  EXPECT_EQ(local.origin, glm::dvec3(0));
  EXPECT_EQ(moved.origin, GetParam());
  EXPECT_EQ(moved.cube, local.cube);
  EXPECT_LE(glm::length(moved.bounds.max - local.bounds.max), 1e-6f);
}

// What a file has lost already is told.
TEST_P(MovedCloudTest, FloatsFarFromZeroAreTold) {
  std::vector<Surfel> cloud = roomCorner();
  for (Surfel& surfel : cloud) {
    surfel.position = glm::vec3(glm::dvec3(surfel.position) + GetParam());
  }
  Result<SurfelWriter> writer = SurfelWriter::create(path("floats.ply"), kLitChannels);
  ASSERT_TRUE(writer.ok() && writer->write(cloud).ok() && writer->finish().ok());
  NoteKeeper notes;
  ASSERT_TRUE(indexClouds({path("floats.ply")}, path("floats.sft"), IndexOptions(), notes).ok());
  const auto tells = [&] {
    return std::count_if(notes.notes.begin(), notes.notes.end(), [](const std::string& note) {
      return note.find("floats.ply: positions are floats, which stand") != std::string::npos;
    });
  };
  EXPECT_EQ(tells(), 1);
  ASSERT_TRUE(indexClouds({path("moved.ply")}, path("again.sft"), IndexOptions(), notes).ok());
  ASSERT_TRUE(indexClouds({path("local.ply")}, path("again.sft"), IndexOptions(), notes).ok());
  EXPECT_EQ(tells(), 1);
}

TEST_P(MovedCloudTest, GathersTheSame) {
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  gatherBoth(options, ".lit.ply");
  expectSame("local.lit.ply", "moved.lit.ply", "occlusion", kLimit);
  expectSame("local.lit.ply", "moved.lit.ply", "irradiance_b", kLimit);
  options.mode = GatherMode::kGlossy;
  options.eye = {5, -8, 6};
  gatherBoth(options, ".glossy.ply");
  expectSame("local.glossy.ply", "moved.glossy.ply", "reflection_r", kLimit);
}

TEST_P(MovedCloudTest, ResultsKeepTheDoublesOfTheReceivers) {
  gatherBoth({}, ".ao.ply");
  EXPECT_EQ(valuesOf("moved.ao.ply", "y"), valuesOf("moved.ply", "y"));
}

TEST_P(MovedCloudTest, CubesShowTheSame) {
  GatherOptions options;
  options.mode = GatherMode::kBleeding;
  const glm::dvec3 place(5, 9, 0.01);
  const auto local = gatherCube(path("local.sft"), {place, {0, 0, 1}}, options, progress_);
  const auto moved =
      gatherCube(path("moved.sft"), {place + GetParam(), {0, 0, 1}}, options, progress_);
  ASSERT_TRUE(local.ok() && moved.ok());
  EXPECT_GT(local->occlusion, 0.1f);
  EXPECT_NEAR(local->occlusion, moved->occlusion, kLimit);
  EXPECT_EQ(moved->receiver.position, place + GetParam());
}

TEST_P(MovedCloudTest, BouncesTheSameAndKeepsItsPlace) {
  for (const std::string name : {"local", "moved"}) {
    BounceOptions options;
    options.threads = 1;
    ASSERT_TRUE(bounceScene(path(name + ".sft"), path(name + ".b.sft"), options, progress_).ok());
  }
  expectSame("local.b.sft", "moved.b.sft", "radiosity_r", kLimit);
  const std::vector<double> x = valuesOf("moved.b.sft", "x"), old = valuesOf("moved.sft", "x");
  EXPECT_EQ(x, old);
}

TEST_P(MovedCloudTest, ScenesAreCloudsAtTheirPlace) {
  const std::vector<double> local = valuesOf("local.sft", "y"), moved = valuesOf("moved.sft", "y");
  ASSERT_EQ(local.size(), roomCorner().size());
  ASSERT_EQ(moved.size(), local.size());
  for (std::size_t i = 0; i < local.size(); ++i) {
    ASSERT_NEAR(moved[i], local[i] + GetParam().y, 1e-6);
  }
  // And indexed again they stand there
  const auto again = indexClouds({path("moved.sft")}, path("again.sft"), IndexOptions(), progress_);
  ASSERT_TRUE(again.ok()) << again.status().message();
  EXPECT_EQ(headerOf("again").origin, GetParam());
}

// To steps of the root cube, which is 16 units wide
INSTANTIATE_TEST_SUITE_P(Places, MovedCloudTest,
                         testing::Values(glm::dvec3(5e5, 5e6, 100),
                                         glm::dvec3(-3923410, 0, 5002803), glm::dvec3(0, 0, 1e9)));

}  // namespace
}  // namespace surfeit
