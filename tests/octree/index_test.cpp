#include "surfeit/index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <random>

#include "io/test_bytes.h"
#include "octree/build/curve_sort.h"
#include "octree/page/surfel_marks.h"
#include "octree/test_scenes.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

// Options with one thing changed.
template <typename Options, typename Value>
IndexOptions optionsWith(Value Options::*field, const Value& value) {
  IndexOptions options;
  options.*field = value;
  return options;
}

const IndexOptions kFullPrecision = optionsWith(&IndexOptions::full_precision, true);

class IndexTest : public SceneTest {
 protected:
  // Everything that docs/format.md promises of a scene with these surfels.
  void expectSound(const std::string& scene_path, std::size_t surfel_count) {
    EXPECT_THAT(findingsOf(scene_path), IsEmpty());
    const Result<ReadScene> scene = readScene(scene_path);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    const SceneHeader& header = scene->header;
    EXPECT_EQ(scene->surfels.size(), surfel_count);
    EXPECT_EQ(header.surfel_count, surfel_count);
    EXPECT_EQ(header.node_count, scene->nodes.size());
    for (const ReadScene::ReadNode& read : scene->nodes) {
      expectNodeIsSound(header, read.node, std::span(scene->surfels).subspan(read.first_surfel));
      if (HasFatalFailure()) return;
    }
  }

  // `surfels`: those of the node come first.
  static void expectNodeIsSound(const SceneHeader& header, const Node& node,
                                std::span<const Surfel> surfels) {
    ASSERT_LE(node.surfel_count, surfels.size());
    surfels = surfels.first(node.surfel_count);
    if (!node.isLeaf()) {
      EXPECT_GE(node.child_count, 2);
      EXPECT_GT(node.surfel_count, header.leaf_capacity);
    } else if (node.first > 0) {
      // Only a leaf that begins a page may run over its end
      EXPECT_LE(node.first + node.surfel_count, header.surfel_group_capacity);
    }
    EXPECT_FALSE(node.isFlat() && node.hasFacets());
    EXPECT_EQ(node.isRough(), !node.hasFacets() && node.rough.sh[0][kAreaKind] != 0);
    for (const Surfel& surfel : surfels) {
      ASSERT_LE(glm::length(surfel.position - node.position) + surfel.radius, node.radius * 1.002f);
    }
  }

  Result<IndexStats> tryIndex(const std::vector<std::string>& inputs,
                              const IndexOptions& options = {}) {
    return indexClouds(inputs, path("out.sft"), options, progress_);
  }
};

std::vector<Surfel> sortedByContent(std::vector<Surfel> surfels) {
  std::sort(surfels.begin(), surfels.end(), contentLess);
  return surfels;
}

TEST_F(IndexTest, CloudsOfManyShapesMakeSoundScenes) {
  const std::map<std::string, std::vector<Surfel>> clouds = {
      {"one", randomCloud(1)},
      {"two", randomCloud(2)},
      {"leaf", randomCloud(16)},
      {"leaf and one", randomCloud(17)},
      {"random", randomCloud(5000)},
      {"sphere", sphereCloud(5000)},
      {"plane", planeCloud(70, 0.1f)},
      {"far away", moved(randomCloud(3000), 1, {1e6f, -2e6f, 3e6f})},
      {"huge", moved(sphereCloud(3000), 1e9f, {1e9f, 0, 0})},
      {"largest", moved(randomCloud(3000), 1e12f, {0, 0, 0})},
      {"tiny", moved(randomCloud(3000), 1e-9f, {0, 0, 0})},
      {"line",
       [] {
         std::vector<Surfel> line = randomCloud(3000);
         for (Surfel& surfel : line) surfel.position.y = surfel.position.z = 0;
         return line;
       }()},
  };
  for (const auto& [name, cloud] : clouds) {
    SCOPED_TRACE(name);
    expectSound(index(cloud), cloud.size());
    expectSound(index(cloud, kAllChannels, kFullPrecision), cloud.size());
    expectSound(index(cloud, kPositionsOnly), cloud.size());
  }
}

TEST_F(IndexTest, ClustersOfAllSizesMakeASoundScene) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 12; ++i) {
    TestRandom random(static_cast<std::uint32_t>(100 + i));
    for (const Surfel& surfel : moved(randomCloud(400, static_cast<std::uint32_t>(i)),
                                      std::pow(10.f, float(-i)), random.point() * 1000.f)) {
      cloud.push_back(surfel);
    }
  }
  expectSound(index(cloud), cloud.size());
  expectSound(index(cloud, kPositionsOnly), cloud.size());
}

TEST_F(IndexTest, SurfelsAtOnePositionMakeOneLeaf) {
  for (const std::size_t count : {15u, 16u, 17u, 100u, 512u, 513u, 2000u, 5000u}) {
    SCOPED_TRACE(count);
    std::vector<Surfel> cloud = randomCloud(count);
    for (Surfel& surfel : cloud) surfel.position = {3, 4, 5};
    for (const CloudChannels& channels : {kAllChannels, kPositionsOnly}) {
      const std::string scene = index(cloud, channels);
      expectSound(scene, count);
      const Result<SceneInfo> info = readSceneInfo(scene);
      ASSERT_TRUE(info.ok());
      EXPECT_EQ(info->nodes, 1u);
    }
  }
}

TEST_F(IndexTest, CrowdedCellsAmongOthersMakeASoundScene) {
  std::vector<Surfel> cloud = randomCloud(4000);
  for (std::size_t i = 0; i < 3000; ++i) cloud[i].position = cloud[i % 3].position;
  expectSound(index(cloud), cloud.size());
  expectSound(index(cloud, kPositionsOnly), cloud.size());
}

TEST_F(IndexTest, LeafCapacityIsKept) {
  const std::vector<Surfel> cloud = randomCloud(5000);
  for (const std::uint32_t capacity : {1u, 2u, 7u, 64u, 512u, 700u, 4096u}) {
    SCOPED_TRACE(capacity);
    const std::string scene =
        index(cloud, kAllChannels, optionsWith(&IndexOptions::leaf_capacity, capacity));
    expectSound(scene, cloud.size());
    const Result<ReadScene> read = readScene(scene);
    ASSERT_TRUE(read.ok());
    for (const auto& [node, first] : read->nodes) {
      EXPECT_TRUE(!node.isLeaf() || node.surfel_count <= capacity);
    }
  }
}

TEST_F(IndexTest, FullPrecisionKeepsEverySurfelOnceInCurveOrder) {
  Result<ReadScene> scene = readScene(index(randomCloud(10000), kAllChannels, kFullPrecision));
  ASSERT_TRUE(scene.ok());
  // Marks are the indexer's own
  for (Surfel& surfel : scene->surfels) surfel.flags &= std::uint16_t(~kSurfelMarks);
  // As the indexer reads them: with normals normalised once more
  std::vector<Surfel> cloud(10000);
  const auto source = openSurfelSource(path("scene1.ply"), /* strict= */ true);
  ASSERT_TRUE(source.ok());
  ASSERT_EQ((*source)->read(cloud).value(), cloud.size());
  EXPECT_TRUE(areEqual(sortedByContent(scene->surfels), sortedByContent(cloud)));
  CurveKey last = 0;
  for (const Surfel& surfel : scene->surfels) {
    const CurveKey key = curveKey(surfel.position, scene->header.cube);
    EXPECT_GE(key, last);
    last = key;
  }
}

TEST_F(IndexTest, QuantizedSurfelsStayWithinTheFormatsErrors) {
  const std::vector<Surfel> cloud = randomCloud(10000);
  const Result<ReadScene> exact = readScene(index(cloud, kAllChannels, kFullPrecision));
  const Result<ReadScene> stored = readScene(index(cloud));
  ASSERT_TRUE(exact.ok() && stored.ok());
  ASSERT_EQ(exact->surfels.size(), stored->surfels.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Surfel& a = exact->surfels[i];
    const Surfel& b = stored->surfels[i];
    ASSERT_LE(glm::length(a.position - b.position), 1.01e-3f * a.radius);
    ASSERT_LE(glm::length(a.normal - b.normal), 1e-4f);
    ASSERT_NEAR(b.radius, a.radius, 1e-3f * a.radius);
    ASSERT_NEAR(b.area, a.area, 1e-3f * a.area);
    ASSERT_LE(glm::length(a.radiosity - b.radiosity), 1e-3f * glm::length(a.radiosity));
    ASSERT_LE(glm::length(a.albedo - b.albedo), 8e-3f);
    ASSERT_EQ(a.flags, b.flags);
  }
}

TEST_F(IndexTest, OrderThreadsAndMemoryDoNotChangeTheFile) {
  std::vector<Surfel> cloud = randomCloud(400000);
  for (std::size_t i = 0; i < 2000; ++i) cloud[i * 7] = cloud[3];  // equal ones too
  for (const CloudChannels& channels : {kAllChannels, kPositionsOnly}) {
    if (!channels.radius) cloud.resize(isThreadSanitized() ? 130000 : 200000);
    writeCloud(path("a.ply"), cloud, channels);
    const IndexStats in_memory = indexFiles({path("a.ply")}, path("a.sft"));
    std::shuffle(cloud.begin(), cloud.end(), std::mt19937(1));
    writeCloud(path("b.ply"), cloud, channels);
    IndexOptions small;
    small.memory_bytes = 64 << 20;
    small.threads = 1;
    const IndexStats spilled = indexFiles({path("b.ply")}, path("b.sft"), small);
    EXPECT_GT(spilled.temporary_bytes, in_memory.temporary_bytes + cloud.size() * 8);
    indexFiles({path("b.ply")}, path("c.sft"), optionsWith(&IndexOptions::threads, 2));
    const std::string expected = contents("a.sft");
    EXPECT_TRUE(contents("b.sft") == expected);
    EXPECT_TRUE(contents("c.sft") == expected);
    if (channels.radius) expectSound(path("a.sft"), cloud.size());
  }
}

TEST_F(IndexTest, SeveralInputsAreAsGoodAsOne) {
  const std::vector<Surfel> cloud = randomCloud(5000);
  const std::span<const Surfel> all = cloud;
  writeCloud(path("all.ply"), all);
  writeCloud(path("a.ply"), all.first(1000));
  writeCloud(path("b.ply"), all.subspan(1000, 1));
  writeCloud(path("c.ply"), all.subspan(1001));
  indexFiles({path("all.ply")}, path("one.sft"));
  indexFiles({path("c.ply"), path("a.ply"), path("b.ply")}, path("many.sft"));
  EXPECT_TRUE(contents("one.sft") == contents("many.sft"));
}

TEST_F(IndexTest, NodesAreTheSumsOfTheirSurfels) {
  for (const bool full : {true, false}) {
    const Result<ReadScene> scene = readScene(
        index(randomCloud(3000), kAllChannels, optionsWith(&IndexOptions::full_precision, full)));
    ASSERT_TRUE(scene.ok());
    const double tolerance = full ? 1e-5 : 5e-3;
    for (const auto& [node, first] : scene->nodes) {
      double area = 0, position[3] = {}, normal[3] = {}, radiosity[3] = {};
      double area_sh[kShCount] = {}, power_sh[kShCount] = {};
      const bool turns = node.isFlat() && node.isTwoSided();  // all of them to one side
      for (std::size_t i = first; i < first + node.surfel_count; ++i) {
        const Surfel& surfel = scene->surfels[i];
        const double a = double(surfel.area);
        area += a;
        const ZonalFactors& factors = surfel.isSphere()     ? kConstant
                                      : surfel.isTwoSided() ? kAbsoluteCosine
                                                            : kClampedCosine;
        const ShCoefficients basis = shBasis(surfel.normal);
        for (int axis = 0; axis < 3; ++axis) {
          position[axis] += a * double(surfel.position[axis]);
          radiosity[axis] += a * double(surfel.radiosity[axis]);
          const double side = turns && glm::dot(surfel.normal, node.normal) < 0 ? -1 : 1;
          if (surfel.flags == 0 || turns) normal[axis] += side * a * double(surfel.normal[axis]);
        }
        for (int k = 0; k < (surfel.isSphere() ? 1 : kShCount); ++k) {
          const double lobe = a * double(factors[kShBand[k]]) * double(basis[k]);
          area_sh[k] += lobe;
          power_sh[k] += lobe * double(surfel.radiosity.y);
        }
      }
      ASSERT_NEAR(double(node.area), area, tolerance * area);
      const double length = std::hypot(normal[0], normal[1], normal[2]);
      ASSERT_NEAR(double(node.flatness), length / area, tolerance);
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(double(node.position[axis]), position[axis] / area,
                    tolerance * double(node.radius));
        ASSERT_NEAR(double(node.radiosity[axis]), radiosity[axis] / area, tolerance);
        // The sum's direction is as sure as the sum is long
        ASSERT_NEAR(double(node.normal[axis]) * length / area, normal[axis] / area, tolerance);
      }
      for (int k = 0; k < kShCount && node.isRough(); ++k) {
        ASSERT_NEAR(double(node.rough.sh[k][kAreaKind]), area_sh[k], tolerance * area);
        ASSERT_NEAR(double(node.rough.sh[k][powerKind(1)]), power_sh[k], tolerance * area);
      }
    }
  }
}

TEST_F(IndexTest, PlaneIsFlatAndRandomCloudIsNot) {
  const Result<ReadScene> plane = readScene(index(planeCloud(40, 1)));
  const Result<ReadScene> random = readScene(index(randomCloud(1600)));
  ASSERT_TRUE(plane.ok() && random.ok());
  EXPECT_TRUE(plane->nodes[0].node.isFlat());
  EXPECT_NEAR(plane->nodes[0].node.normal.z, 1, 1e-4f);
  EXPECT_FALSE(random->nodes[0].node.isFlat());
}

TEST_F(IndexTest, GridOfPointsGetsDisksThatJustCoverIt) {
  const std::string scene_path = index(planeCloud(60, 0.1f), kPositionsOnly);
  const Result<ReadScene> scene = readScene(scene_path);
  ASSERT_TRUE(scene.ok());
  for (const Surfel& surfel : scene->surfels) {
    // A cell of s^2, and a disk of twice its second moment
    ASSERT_NEAR(surfel.radius, 0.0816f, 1e-4f);
    ASSERT_NEAR(surfel.area, 0.01f, 1e-5f);
    ASSERT_TRUE(surfel.isSphere());
    ASSERT_EQ(surfel.flags, kSurfelSphere);
  }
  EXPECT_THAT(progress_.notes, Contains(HasSubstr("neither radius nor area")));
  EXPECT_THAT(progress_.notes, Contains(HasSubstr("no normal")));
  const Result<SceneInfo> info = readSceneInfo(scene_path);
  EXPECT_FALSE(info->channels.radius || info->channels.area || info->channels.normal);
  EXPECT_THAT(info->provenance, HasSubstr("\"sizes_from_neighbours\":3600"));
}

TEST_F(IndexTest, AStrayPointStaysSmall) {
  std::vector<Surfel> cloud = planeCloud(50, 0.1f);
  cloud[0].position = {-100, -100, 100};
  const Result<ReadScene> scene = readScene(index(cloud, kPositionsOnly));
  ASSERT_TRUE(scene.ok());
  for (const Surfel& surfel : scene->surfels) ASSERT_LT(surfel.radius, 1.f);
}

TEST_F(IndexTest, AreaAndRadiusFollowFromEachOtherOffSurfaces) {
  const std::vector<Surfel> cloud = randomCloud(1000);
  const CloudChannels radii = {.normal = true, .radius = true};
  const CloudChannels areas = {.normal = true, .area = true};
  for (const float overlap : {1.f, 2.f, 4.f}) {
    for (const CloudChannels& channels : {radii, areas}) {
      IndexOptions options = kFullPrecision;
      options.disk_overlap = overlap;
      const Result<ReadScene> scene = readScene(index(cloud, channels, options));
      ASSERT_TRUE(scene.ok());
      for (const Surfel& surfel : scene->surfels) {
        const float disk = kPi * surfel.radius * surfel.radius;
        ASSERT_NEAR(disk, surfel.area * overlap, 1e-5f * disk);
      }
    }
  }
  EXPECT_THAT(progress_.notes, Contains(HasSubstr("have no area")));
  EXPECT_THAT(progress_.notes, Contains(HasSubstr("have an area and no radius")));
}

TEST_F(IndexTest, ManyPointsAtOnePositionAreSizedInReasonableTime) {
  std::vector<Surfel> cloud = randomCloud(60000);
  for (std::size_t i = 0; i < 50000; ++i) cloud[i].position = {0, 0, 0};
  expectSound(index(cloud, kPositionsOnly), cloud.size());
}

TEST_F(IndexTest, SizesOfExtremeRatioMakeASoundScene) {
  // Ratios beyond the range of floats, areas that underflow
  std::vector<Surfel> cloud = randomCloud(100);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud[i].radius = i % 2 == 0 ? 1e-30f : 1e9f;
  }
  const CloudChannels radii = {.normal = true, .radius = true};
  expectSound(index(cloud, radii), cloud.size());
  expectSound(index(cloud, radii, kFullPrecision), cloud.size());
}

TEST_F(IndexTest, ValuesTooLargeToSquareAreSkippedOrRefused) {
  for (int field = 0; field < 4; ++field) {
    SCOPED_TRACE(field);
    std::vector<Surfel> cloud = randomCloud(100);
    if (field == 0) cloud[50].position.y = -3e38f;
    if (field == 1) cloud[50].radius = 3e38f;
    if (field == 2) cloud[50].area = 3e38f;
    if (field == 3) cloud[50].radiosity.z = 3e38f;
    writeCloud(path("a.ply"), cloud);
    const std::ptrdiff_t files_before = fileCount();
    const Result<IndexStats> strict =
        tryIndex({path("a.ply")}, optionsWith(&IndexOptions::strict, true));
    ASSERT_FALSE(strict.ok());
    EXPECT_EQ(strict.status().code(), StatusCode::kCorruption);
    EXPECT_THAT(strict.status().message(), HasSubstr("a.ply"));
    EXPECT_EQ(fileCount(), files_before);

    const Result<IndexStats> stats = tryIndex({path("a.ply")});
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_EQ(stats->surfels, 99u);
    EXPECT_EQ(stats->skipped_records, 1u);
  }
}

TEST_F(IndexTest, FailuresSayWhyAndLeaveNothing) {
  writeCloud(path("empty.ply"), {});
  std::vector<Surfel> bad = randomCloud(10);
  for (Surfel& surfel : bad) surfel.radius = -1;
  writeCloud(path("bad.ply"), bad);
  writeCloud(path("good.ply"), randomCloud(10));
  write("text.ply", "hello");
  const struct {
    std::vector<std::string> inputs;
    IndexOptions options;
    StatusCode code;
    const char* message;
  } cases[] = {
      {{}, {}, StatusCode::kInvalidArgument, "no input"},
      {{path("empty.ply")}, {}, StatusCode::kCorruption, "empty.ply: no valid surfel in 0 records"},
      {{path("bad.ply")}, {}, StatusCode::kCorruption, "bad.ply: no valid surfel in 10 records"},
      {{path("bad.ply")},
       optionsWith(&IndexOptions::strict, true),
       StatusCode::kCorruption,
       "radius"},
      {{path("text.ply")}, {}, StatusCode::kCorruption, "text.ply"},
      {{path("absent.ply")}, {}, StatusCode::kIoError, "absent.ply"},
      {{path("good.ply"), path("absent.ply")}, {}, StatusCode::kIoError, "absent.ply"},
      {{path("good.ply")},
       optionsWith(&IndexOptions::memory_bytes, std::uint64_t{63} << 20),
       StatusCode::kBudgetTooSmall,
       "64 MiB"},
      {{path("good.ply")},
       optionsWith(&IndexOptions::leaf_capacity, 0u),
       StatusCode::kInvalidArgument,
       "leaf capacity"},
      {{path("good.ply")},
       optionsWith(&IndexOptions::disk_overlap, NAN),
       StatusCode::kInvalidArgument,
       "overlap"},
      {{path("good.ply")},
       optionsWith(&IndexOptions::temporary_directory, path("nowhere")),
       StatusCode::kIoError,
       "nowhere"},
  };
  const std::ptrdiff_t files = fileCount();
  for (const auto& expected : cases) {
    SCOPED_TRACE(expected.message);
    const Result<IndexStats> stats = tryIndex(expected.inputs, expected.options);
    ASSERT_FALSE(stats.ok());
    EXPECT_EQ(stats.status().code(), expected.code) << stats.status().message();
    EXPECT_THAT(stats.status().message(), HasSubstr(expected.message));
    EXPECT_EQ(fileCount(), files);
  }
  const Result<IndexStats> nowhere =
      indexClouds({path("good.ply")}, path("nowhere/out.sft"), {}, progress_);
  ASSERT_FALSE(nowhere.ok());
  EXPECT_EQ(nowhere.status().code(), StatusCode::kIoError);
}

// Cancels after some calls of isCancelled.
class CancelAfter : public Progress {
 public:
  explicit CancelAfter(int calls) : calls_(calls) {}
  bool isCancelled() const override { return calls_-- <= 0; }

 private:
  mutable int calls_;
};

TEST_F(IndexTest, CancelledRunLeavesNothingAndTheOldFileAlone) {
  writeCloud(path("a.ply"), randomCloud(500), kPositionsOnly);
  write("out.sft", "old");
  bool finished = false;
  int calls = 0;
  for (; !finished; ++calls) {
    CancelAfter progress(calls);
    const Result<IndexStats> stats = indexClouds({path("a.ply")}, path("out.sft"), {}, progress);
    finished = stats.ok();
    if (finished) break;
    ASSERT_EQ(stats.status().code(), StatusCode::kInterrupted);
    ASSERT_EQ(fileCount(), 2);
    ASSERT_EQ(contents("out.sft"), "old");
  }
  EXPECT_GT(calls, 4);
  EXPECT_THAT(findingsOf(path("out.sft")), IsEmpty());
}

TEST_F(IndexTest, SkippedRecordsAreCountedAndTold) {
  std::vector<Surfel> cloud = randomCloud(100);
  cloud[10].radius = -1;
  cloud[20].position.x = NAN;
  writeCloud(path("a.ply"), cloud);
  const IndexStats stats = indexFiles({path("a.ply")}, path("a.sft"));
  EXPECT_EQ(stats.surfels, 98u);
  EXPECT_EQ(stats.skipped_records, 2u);
  EXPECT_THAT(progress_.notes, Contains(HasSubstr("a.ply: skipped")));
}

TEST_F(IndexTest, StatsAndInfoAgreeWithTheFile) {
  writeCloud(path("a.ply"), randomCloud(3000));
  const IndexStats stats = indexFiles({path("a.ply")}, path("a.sft"));
  const Result<SceneInfo> info = readSceneInfo(path("a.sft"));
  const Result<ReadScene> scene = readScene(path("a.sft"));
  ASSERT_TRUE(info.ok() && scene.ok());
  EXPECT_EQ(stats.surfels, 3000u);
  EXPECT_EQ(info->surfels, 3000u);
  EXPECT_EQ(stats.nodes, scene->nodes.size());
  EXPECT_EQ(info->nodes, stats.nodes);
  EXPECT_EQ(stats.file_bytes, contents("a.sft").size());
  EXPECT_EQ(info->file_bytes, stats.file_bytes);
  EXPECT_EQ(info->node_pages, stats.node_pages);
  EXPECT_EQ(info->surfel_pages, stats.surfel_pages);
  EXPECT_LT(info->node_page_bytes + info->surfel_page_bytes, info->file_bytes);
  ASSERT_EQ(info->level_pages.size(), 22u);
  EXPECT_EQ(info->level_pages[0], 1u);
  EXPECT_TRUE(info->channels.albedo && info->channels.two_sided);
}

}  // namespace
}  // namespace surfeit
