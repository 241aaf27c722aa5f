// An index by shards: the merge has the bytes of one machine, whatever is lost or damaged in
// between.
#include "surfeit/index_shards.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "index/index_shard_file.h"
#include "index/index_shard_ranges.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr IndexPass kPasses[] = {IndexPass::kCount, IndexPass::kDistribute, IndexPass::kBuild};
constexpr IndexPass kPassesWithNeighbours[] = {IndexPass::kCount, IndexPass::kDistribute,
                                               IndexPass::kBuild, IndexPass::kPlaces,
                                               IndexPass::kSizes};

// Surfels on a few spheres of several sizes, so that some parts of the curve are dense, in any
// order.
std::vector<Surfel> unevenCloud(std::size_t count) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 4; ++i) {
    const float size = i < 2 ? 1.f : 0.1f * float(i);
    for (const Surfel& surfel : moved(sphereCloud(count / 4), size, {2.1f * float(i), 0.3f, 0})) {
      cloud.push_back(surfel);
    }
  }
  std::shuffle(cloud.begin(), cloud.end(), std::mt19937(5));
  return cloud;
}

class IndexShards : public SceneTest {
 protected:
  void SetUp() override {
    SceneTest::SetUp();
    out_ = path("out.sft");
    options_.threads = 2;
    options_.memory_bytes = 256 << 20;
  }

  Status pass(IndexPass pass, int shard, int count) {
    const Result<IndexShardStats> stats =
        indexShards(inputs_, out_, options_, pass, {shard, shard, count}, progress_);
    if (stats.ok()) finished_ += stats->finished_shards;
    return stats.status();
  }
  Status merge(int count, bool removes = false) {
    return mergeIndexShards(inputs_, out_, options_, count, removes, progress_).status();
  }
  // All passes. Shards come in an order that changes with the pass, with one and two threads.
  void indexAll(int count) {
    for (const IndexPass which : passes_) {
      // Shards that had to wait for others come again
      int left = count;
      for (int i = 0; i < 2 * count && left > 0; ++i) {
        options_.threads = 1 + i % 2;
        const int next = i % count;
        const int shard = 1 + (which == IndexPass::kDistribute ? count - 1 - next : next);
        const Status status = pass(which, shard, count);
        if (status.ok()) --left;
        ASSERT_TRUE(status.ok() || status.code() == StatusCode::kIncomplete) << status.message();
      }
      ASSERT_LE(left, 0);
    }
    const Status merged = merge(count);
    ASSERT_TRUE(merged.ok()) << merged.message();
  }
  // Against one machine; `ranges`: so many shards at least have something to build.
  void expectSameBytes(int count, int ranges = 1) {
    SCOPED_TRACE(count);
    indexFiles(inputs_, path("one.sft"), options_);
    indexAll(count);
    if (HasFatalFailure()) return;
    EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
    EXPECT_GE(builtRanges(count), ranges);
    ASSERT_TRUE(merge(count, /* removes= */ true).ok());
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr("-of-")));
      EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr(".places")));
    }
  }
  int builtRanges(int count) {
    int ranges = 0;
    for (int shard = 1; shard <= count; ++shard) {
      const auto reader =
          IndexShardReader::open(indexShardPath(out_, IndexPass::kBuild, shard, count));
      EXPECT_TRUE(reader.ok());
      if (reader.ok() && reader->payloadBytes() > 0) ++ranges;
    }
    return ranges;
  }
  void writeInput(const std::string& name, std::span<const Surfel> cloud,
                  const CloudChannels& channels = kAllChannels) {
    writeCloud(path(name), cloud, channels);
    inputs_.push_back(path(name));
  }

  std::vector<std::string> inputs_;
  std::string out_;
  IndexOptions options_;
  std::span<const IndexPass> passes_ = kPasses;
  int finished_ = 0;
};

// Clouds whose sizes or normals follow from neighbours.
class IndexShardsWithNeighbours : public IndexShards {
 protected:
  IndexShardsWithNeighbours() { passes_ = kPassesWithNeighbours; }

  // Surfels with a place alone, some at the place of another.
  std::vector<Surfel> bareCloud(std::size_t count) {
    std::vector<Surfel> cloud = unevenCloud(count);
    cloud.insert(cloud.end(), cloud.begin(), cloud.begin() + std::ptrdiff_t(count / 50));
    return cloud;
  }
  NormalEstimation toward(NormalOrientation::Toward toward, bool thin_is_two_sided = false) {
    NormalEstimation estimation;
    estimation.orientation.toward = toward;
    estimation.orientation.sensor = {3, 4, 5};
    estimation.thin_is_two_sided = thin_is_two_sided;
    return estimation;
  }
};

TEST_F(IndexShards, AnyNumberOfThemHasTheBytesOfOneMachine) {
  const std::vector<Surfel> cloud = unevenCloud(isThreadSanitized() ? 200000 : 360000);
  writeInput("a.ply", std::span(cloud).first(cloud.size() / 3));
  writeInput("b.ply", std::span(cloud).subspan(cloud.size() / 3));
  for (const int count : {1, 2, 7}) {
    expectSameBytes(count, std::min(count, isThreadSanitized() ? 1 : 4));
  }
}

TEST_F(IndexShards, EveryOptionOfTheSceneHasTheBytesOfOneMachine) {
  std::vector<Surfel> cloud = unevenCloud(220000);
  // Tiles that overlap
  cloud.insert(cloud.end(), cloud.begin(), cloud.begin() + 60000);
  writeInput("a.ply", cloud);
  writeCloud(path("lamp.ply"), sphereCloud(20000), kAllChannels);
  IndexOptions full = options_, thin = options_, pinned = options_;
  full.full_precision = true;
  full.leaf_capacity = 5;
  full.origin = glm::dvec3(0.25, -1, 3);
  thin.repeats = Repeats::kThin;
  thin.named = {{"lamp", path("lamp.ply")}};
  thin.up = UpAxis::kZ;
  pinned.cube = SceneCube{{-20, -20, -20}, 50};
  for (const IndexOptions& options : {full, thin, pinned}) {
    options_ = options;
    expectSameBytes(2, options.repeats == Repeats::kThin ? 1 : 2);
  }
}

// Surfels by one key, and by one position: one leaf that no range divides.
TEST_F(IndexShards, CrowdsStayTogether) {
  std::vector<Surfel> cloud = unevenCloud(100000);
  for (std::size_t i = 0; i < 70000; ++i) cloud[i].position = {0.5f, 0.5f, 0.5f};
  writeInput("a.ply", cloud);
  expectSameBytes(2);
  options_.repeats = Repeats::kThin;
  expectSameBytes(2);
}

// Nine of ten surfels repeat another.
TEST_F(IndexShards, TilesThatRepeatEachOtherAreThinnedInRanges) {
  options_.repeats = Repeats::kThin;
  const std::vector<Surfel> cloud = unevenCloud(120000);
  for (int tile = 0; tile < 10; ++tile) writeInput("a" + std::to_string(tile) + ".ply", cloud);
  expectSameBytes(2, 2);
}

// Of 560,000 surfels before the cut 5,000 are left, which are less than a brick.
TEST_F(IndexShards, CutsThroughBricksThatWereThinnedAreRefused) {
  options_.repeats = Repeats::kThin;
  const std::vector<Surfel> crowd = moved(sphereCloud(5000), 0.1f, glm::vec3(0.2f));
  // Samples of both shards see the crowd: as many places as the rest
  std::vector<Surfel> rest = moved(sphereCloud(10000), 0.1f, glm::vec3(3.2f));
  for (int tile = 0; tile < 112; ++tile) rest.insert(rest.end(), crowd.begin(), crowd.end());
  writeInput("a.ply", rest);
  for (const IndexPass which : kPasses) {
    for (int shard = 1; shard <= 2; ++shard) ASSERT_TRUE(pass(which, shard, 2).ok());
  }
  ASSERT_EQ(builtRanges(2), 2);
  const Status status = merge(2);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("so many surfels repeat others"));
}

TEST_F(IndexShards, SmallAndEmptyPartsAreFine) {
  writeInput("a.ply", sphereCloud(5));
  writeInput("none.ply", {});
  for (const int count : {1, 7}) expectSameBytes(count);
}

TEST_F(IndexShards, LittleMemorySpillsAndHasTheSameBytes) {
  writeInput("a.ply", unevenCloud(150000));
  indexFiles(inputs_, path("one.sft"), options_);
  options_.memory_bytes = 64 << 20;
  for (const IndexPass which : kPasses) {
    for (int shard = 1; shard <= 2; ++shard) {
      options_.threads = 1;
      const Status status = pass(which, shard, 2);
      ASSERT_TRUE(status.ok()) << status.message();
    }
  }
  ASSERT_TRUE(merge(2).ok());
  EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
}

TEST_F(IndexShards, CloudsFarAwayHaveTheBytesOfOneMachine) {
  writeInput("a.ply", moved(unevenCloud(40000), 10, {1e6f, -2e6f, 3e6f}));
  expectSameBytes(2);
}

// A sample asks for an origin beside the cloud; a stray that it does not see, for 0.
TEST_F(IndexShards, AStrayThatNoSampleSeesMakesThemCountAgain) {
  std::vector<Surfel> cloud = moved(sphereCloud(30000), 1, {100, 100, 100});
  cloud[7].position = glm::vec3(0.5f);
  writeInput("a.ply", cloud);
  expectSameBytes(3);
  for (int shard = 1; shard <= 3; ++shard) ASSERT_TRUE(pass(IndexPass::kCount, shard, 3).ok());
  // Whoever is the last counts again; the others when they distribute
  EXPECT_TRUE(std::filesystem::exists(path("out.sft.count2-3-of-3")));
  EXPECT_FALSE(std::filesystem::exists(path("out.sft.count2-1-of-3")));
  const Status early = pass(IndexPass::kDistribute, 1, 3);
  EXPECT_EQ(early.code(), StatusCode::kIncomplete);
  EXPECT_THAT(early.message(), HasSubstr("shards 2 of 3 are missing"));
}

TEST_F(IndexShards, ShardsThatLackAreNamed) {
  writeInput("a.ply", unevenCloud(30000));
  ASSERT_TRUE(pass(IndexPass::kCount, 2, 4).ok());
  Status status = pass(IndexPass::kDistribute, 1, 4);
  EXPECT_EQ(status.code(), StatusCode::kIncomplete);
  EXPECT_THAT(status.message(), HasSubstr("shards 3-4 of 4 are missing"));
  EXPECT_THAT(status.message(), HasSubstr("--pass count for them (sbatch --array=3-4)"));
  for (const int shard : {3, 4}) ASSERT_TRUE(pass(IndexPass::kCount, shard, 4).ok());
  for (const int shard : {1, 3, 4}) ASSERT_TRUE(pass(IndexPass::kDistribute, shard, 4).ok());
  status = pass(IndexPass::kBuild, 1, 4);
  EXPECT_EQ(status.code(), StatusCode::kIncomplete);
  EXPECT_THAT(status.message(), HasSubstr("shards 2 of 4 are missing"));
  EXPECT_THAT(status.message(), HasSubstr("--pass distribute"));
  ASSERT_TRUE(pass(IndexPass::kDistribute, 2, 4).ok());
  for (const int shard : {1, 4}) ASSERT_TRUE(pass(IndexPass::kBuild, shard, 4).ok());
  status = merge(4);
  EXPECT_EQ(status.code(), StatusCode::kIncomplete);
  EXPECT_THAT(status.message(), HasSubstr("shards 2-3 of 4 are missing"));
  EXPECT_FALSE(std::filesystem::exists(out_));
}

TEST_F(IndexShards, FinishedOnesAreSkippedAndDamagedOnesMadeAgain) {
  writeInput("a.ply", unevenCloud(30000));
  indexFiles(inputs_, path("one.sft"), options_);
  indexAll(3);
  finished_ = 0;
  for (const IndexPass which : kPasses) {
    const std::string file = indexShardPath(out_, which, 2, 3);
    ASSERT_TRUE(pass(which, 2, 3).ok());
    EXPECT_EQ(std::exchange(finished_, 0), 1);
    const std::string good = bytesOf(file);
    std::string bad = good;
    bad[good.size() / 2] ^= 0x20;
    for (const std::string& bytes : {bad, good.substr(0, good.size() / 2)}) {
      writeBytes(file, bytes);
      ASSERT_TRUE(pass(which, 2, 3).ok());
      EXPECT_EQ(std::exchange(finished_, 0), 0);
    }
  }
  ASSERT_TRUE(merge(3).ok());
  EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
}

// Every byte of a file that a later pass reads: damage is named, or does not change the result.
TEST_F(IndexShards, DamageIsNamedByThePassBehind) {
  writeInput("a.ply", unevenCloud(20000));
  indexFiles(inputs_, path("one.sft"), options_);
  indexAll(2);
  const auto tryWith = [&](IndexPass damaged, const std::function<Status()>& behind) {
    const std::string file = indexShardPath(out_, damaged, 1, 2);
    const std::string good = bytesOf(file);
    for (std::size_t at = 0; at < good.size(); at += 1 + good.size() / 7) {
      std::string bad = good;
      bad[at] ^= 0x41;
      writeBytes(file, bad);
      const Status status = behind();
      if (status.ok()) {
        EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft"))) << at;
      } else {
        EXPECT_EQ(status.code(), StatusCode::kIncomplete) << at << status.message();
        EXPECT_THAT(status.message(), HasSubstr("shards 1 of 2")) << at;
      }
    }
    writeBytes(file, good);
  };
  const auto build = [&] {
    std::filesystem::remove(indexShardPath(out_, IndexPass::kBuild, 1, 2));
    return pass(IndexPass::kBuild, 1, 2);
  };
  tryWith(IndexPass::kCount, [&] { return merge(2); });
  tryWith(IndexPass::kBuild, [&] { return merge(2); });
  tryWith(IndexPass::kDistribute, build);
}

TEST_F(IndexShards, ShardsOfAnotherJobAreToldApart) {
  writeInput("a.ply", unevenCloud(30000));
  indexAll(2);
  options_.leaf_capacity = 8;
  Status status = merge(2);
  EXPECT_EQ(status.code(), StatusCode::kIncomplete);
  EXPECT_THAT(status.message(), HasSubstr("job/leaf_capacity is 16, expected 8"));
  options_.leaf_capacity = 16;
  // Other surfels in a file of the same size
  writeCloud(inputs_.front(), moved(unevenCloud(30000), 2, {}), kAllChannels);
  status = merge(2);
  EXPECT_TRUE(status.ok()) << status.message();  // the merge reads no rows
  std::filesystem::remove(indexShardPath(out_, IndexPass::kDistribute, 1, 2));
  status = pass(IndexPass::kDistribute, 1, 2);
  EXPECT_EQ(status.code(), StatusCode::kFailed);
  EXPECT_THAT(status.message(), HasSubstr("an input changed meanwhile"));
}

TEST_F(IndexShardsWithNeighbours, AnyNumberOfThemHasTheBytesOfOneMachine) {
  const std::vector<Surfel> cloud = bareCloud(isThreadSanitized() ? 160000 : 360000);
  writeInput("a.ply", std::span(cloud).first(cloud.size() / 3), kPositionsOnly);
  writeInput("b.ply", std::span(cloud).subspan(cloud.size() / 3), kPositionsOnly);
  for (const int count : {1, 2, 7}) {
    expectSameBytes(count, std::min(count, isThreadSanitized() ? 1 : 4));
  }
}

TEST_F(IndexShardsWithNeighbours, NormalsHaveTheBytesOfOneMachine) {
  writeInput("a.ply", bareCloud(isThreadSanitized() ? 60000 : 200000), kPositionsOnly);
  using Toward = NormalOrientation::Toward;
  options_.repeats = Repeats::kThin;
  for (const Toward which : {Toward::kUp, Toward::kOutward, Toward::kSensor, Toward::kConsistent}) {
    SCOPED_TRACE(int(which));
    options_.normals = toward(which, /* thin_is_two_sided= */ which == Toward::kSensor);
    expectSameBytes(3);
    options_.repeats = Repeats::kKeep;
  }
  options_.normals = toward(Toward::kTrajectory);
  EXPECT_EQ(pass(IndexPass::kCount, 1, 3).code(), StatusCode::kInvalidArgument);
}

// A cloud with sizes beside one without; surfels with sizes of which some are no normals.
TEST_F(IndexShardsWithNeighbours, MixedCloudsHaveTheBytesOfOneMachine) {
  const std::vector<Surfel> cloud = bareCloud(150000);
  writeInput("a.ply", std::span(cloud).first(cloud.size() / 2), kPositionsOnly);
  writeInput("b.ply", std::span(cloud).subspan(cloud.size() / 2));
  expectSameBytes(2, 2);
  options_.full_precision = true;
  options_.normals = toward(NormalOrientation::Toward::kUp);
  options_.cube = SceneCube{{-20, -20, -20}, 50};
  expectSameBytes(3);
}

TEST_F(IndexShardsWithNeighbours, SmallAndEmptyPartsAreFine) {
  writeInput("a.ply", sphereCloud(9), kPositionsOnly);
  writeInput("none.ply", {}, kPositionsOnly);
  for (const int count : {1, 7}) expectSameBytes(count);
}

// Surfels with sizes: both passes have nothing to do, and need not be.
TEST_F(IndexShardsWithNeighbours, PassesWithoutNeedDoNothing) {
  writeInput("a.ply", unevenCloud(40000));
  expectSameBytes(2);
  indexAll(2);
  EXPECT_FALSE(std::filesystem::exists(path("out.sft.places")));
  EXPECT_LT(std::filesystem::file_size(indexShardPath(out_, IndexPass::kSizes, 1, 2)), 2000u);
  passes_ = kPasses;
  expectSameBytes(2);
}

TEST_F(IndexShardsWithNeighbours, ShardsThatLackAreNamed) {
  writeInput("a.ply", bareCloud(30000), kPositionsOnly);
  for (const IndexPass which : kPasses) {
    for (int shard = 1; shard <= 3; ++shard) ASSERT_TRUE(pass(which, shard, 3).ok());
  }
  const auto lacks = [&](const Status& status, const char* shards, const char* pass_name) {
    EXPECT_EQ(status.code(), StatusCode::kIncomplete);
    EXPECT_THAT(status.message(), HasSubstr(std::string("shards ") + shards + " of 3 are missing"));
    EXPECT_THAT(status.message(), HasSubstr(std::string("--pass ") + pass_name + " for them"));
  };
  lacks(merge(3), "1", "places");
  lacks(pass(IndexPass::kSizes, 2, 3), "1", "places");
  // Only shard 1 makes them
  ASSERT_TRUE(pass(IndexPass::kPlaces, 2, 3).ok());
  lacks(pass(IndexPass::kSizes, 2, 3), "1", "places");
  ASSERT_TRUE(pass(IndexPass::kPlaces, 1, 3).ok());
  ASSERT_TRUE(pass(IndexPass::kSizes, 2, 3).ok());
  lacks(merge(3), "1, 3", "sizes");
  std::filesystem::remove(path("out.sft.places"));
  lacks(pass(IndexPass::kSizes, 1, 3), "1", "places");
  ASSERT_TRUE(pass(IndexPass::kPlaces, 1, 3).ok());
  for (const int shard : {1, 3}) ASSERT_TRUE(pass(IndexPass::kSizes, shard, 3).ok());
  EXPECT_TRUE(merge(3).ok());
  std::filesystem::remove(indexShardPath(out_, IndexPass::kBuild, 2, 3));
  std::filesystem::remove(path("out.sft.places"));
  lacks(pass(IndexPass::kPlaces, 1, 3), "2", "build");
}

TEST_F(IndexShardsWithNeighbours, FinishedOnesAreSkippedAndDamagedOnesMadeAgain) {
  writeInput("a.ply", bareCloud(30000), kPositionsOnly);
  indexFiles(inputs_, path("one.sft"), options_);
  indexAll(3);
  for (const std::string& file :
       {indexShardPath(out_, IndexPass::kPlaces, 1, 3), path("out.sft.places"),
        indexShardPath(out_, IndexPass::kSizes, 1, 3)}) {
    const bool is_sized = file.find("sized") != std::string::npos;
    const IndexPass which = is_sized ? IndexPass::kSizes : IndexPass::kPlaces;
    finished_ = 0;
    ASSERT_TRUE(pass(which, 1, 3).ok());
    EXPECT_EQ(std::exchange(finished_, 0), 1);
    const std::string good = bytesOf(file);
    std::string bad = good;
    bad[good.size() / 2] ^= 0x20;
    for (const std::string& bytes : {bad, good.substr(0, good.size() / 2), std::string()}) {
      writeBytes(file, bytes);
      ASSERT_TRUE(pass(which, 1, 3).ok());
      EXPECT_EQ(std::exchange(finished_, 0), 0);
      EXPECT_TRUE(bytesOf(file) == good) << file;
    }
  }
  ASSERT_TRUE(merge(3).ok());
  EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
}

// As below, of the passes for neighbours.
TEST_F(IndexShardsWithNeighbours, DamageIsNamedByThePassBehind) {
  writeInput("a.ply", bareCloud(20000), kPositionsOnly);
  indexFiles(inputs_, path("one.sft"), options_);
  indexAll(2);
  const std::string sized = indexShardPath(out_, IndexPass::kSizes, 1, 2);
  const auto tryWith = [&](const std::string& file, const std::function<Status()>& behind) {
    const std::string good = bytesOf(file);
    int named = 0;
    for (std::size_t at = 0; at < good.size(); at += 1 + good.size() / 17) {
      std::string bad = good;
      bad[at] ^= 0x41;
      writeBytes(file, bad);
      const Status status = behind();
      if (status.ok()) {
        EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft"))) << at;
      } else {
        EXPECT_EQ(status.code(), StatusCode::kIncomplete) << at << status.message();
        EXPECT_THAT(status.message(), HasSubstr("shards 1 of 2")) << at;
        ++named;
      }
    }
    EXPECT_GT(named, 4) << file;
    writeBytes(file, good);
  };
  const auto size = [&] {
    std::filesystem::remove(sized);
    const Status status = pass(IndexPass::kSizes, 1, 2);
    return status.ok() ? merge(2) : status;
  };
  tryWith(path("out.sft.places"), size);
  tryWith(indexShardPath(out_, IndexPass::kPlaces, 1, 2), size);
  ASSERT_TRUE(size().ok());
  tryWith(sized, [&] { return merge(2); });
  tryWith(indexShardPath(out_, IndexPass::kPlaces, 1, 2), [&] { return merge(2); });
}

TEST_F(IndexShardsWithNeighbours, ShardsOfOtherNormalsAreToldApart) {
  writeInput("a.ply", bareCloud(20000), kPositionsOnly);
  options_.normals = toward(NormalOrientation::Toward::kUp);
  indexAll(2);
  options_.normals = toward(NormalOrientation::Toward::kSensor);
  EXPECT_EQ(merge(2).code(), StatusCode::kIncomplete);
  indexAll(2);
  options_.normals->orientation.sensor.z = 7;
  EXPECT_EQ(merge(2).code(), StatusCode::kIncomplete);
  // The places of the other job
  for (const IndexPass which : kPasses) {
    for (int shard = 1; shard <= 2; ++shard) ASSERT_TRUE(pass(which, shard, 2).ok());
  }
  const std::string before = bytesOf(path("out.sft.places"));
  ASSERT_TRUE(pass(IndexPass::kPlaces, 1, 2).ok());
  const std::string after = bytesOf(path("out.sft.places"));
  options_.leaf_capacity = 9;
  indexAll(2);
  EXPECT_TRUE(after != bytesOf(path("out.sft.places")));
  options_.leaf_capacity = 16;
  indexAll(2);
  EXPECT_TRUE(after == bytesOf(path("out.sft.places")));
}

TEST_F(IndexShardsWithNeighbours, LittleMemoryHasTheSameBytes) {
  writeInput("a.ply", bareCloud(120000), kPositionsOnly);
  options_.normals = toward(NormalOrientation::Toward::kConsistent);
  indexFiles(inputs_, path("one.sft"), options_);
  options_.memory_bytes = 64 << 20;
  options_.threads = 1;
  for (const IndexPass which : passes_) {
    for (int shard = 1; shard <= 2; ++shard) {
      const Status status = pass(which, shard, 2);
      ASSERT_TRUE(status.ok()) << status.message();
    }
  }
  const Status merged = merge(2);
  ASSERT_TRUE(merged.ok()) << merged.message();
  EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
}

TEST_F(IndexShardsWithNeighbours, ForecastsComeTrue) {
  writeInput("a.ply", bareCloud(240000), kPositionsOnly);
  options_.temporary_directory = directory_.string();
  const auto may_need = mayNeedNeighbours(inputs_, options_);
  ASSERT_TRUE(may_need.ok());
  EXPECT_TRUE(*may_need);
  const auto forecast = forecastIndexShards(inputs_, out_, options_, 3, progress_);
  ASSERT_TRUE(forecast.ok()) << forecast.status().message();
  EXPECT_TRUE(forecast->may_need_neighbours);
  options_.memory_bytes = forecast->memory_bytes;
  EXPECT_LT(options_.memory_bytes, std::uint64_t{256} << 20);
  indexAll(3);
  if (HasFatalFailure()) return;
  std::uint64_t shard_bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    const std::string name = entry.path().string();
    const bool is_shard = name.find("-of-") != std::string::npos || name.ends_with(".places");
    shard_bytes += is_shard ? entry.file_size() : 0;
  }
  EXPECT_NEAR(double(forecast->shard_bytes) / double(shard_bytes), 1, 0.3);
  options_.normals = toward(NormalOrientation::Toward::kConsistent);
  const auto sides = forecastIndexShards(inputs_, out_, options_, 3, progress_);
  ASSERT_TRUE(sides.ok());
  EXPECT_GT(sides->merge_seconds, forecast->merge_seconds);
}

// What a plan says of files is what they take, about, and its memory is enough.
TEST_F(IndexShards, ForecastsComeTrue) {
  const std::vector<Surfel> cloud = unevenCloud(240000);
  writeInput("a.ply", cloud);
  options_.temporary_directory = directory_.string();
  const auto forecast = forecastIndexShards(inputs_, out_, options_, 3, progress_);
  ASSERT_TRUE(forecast.ok()) << forecast.status().message();
  EXPECT_EQ(forecast->records, cloud.size());
  EXPECT_FALSE(forecast->may_need_neighbours);
  EXPECT_GT(forecast->task_seconds, 0);
  EXPECT_GT(forecast->merge_seconds, 0);
  options_.memory_bytes = forecast->memory_bytes;
  EXPECT_LT(options_.memory_bytes, std::uint64_t{128} << 20);
  indexAll(3);
  if (HasFatalFailure()) return;
  std::uint64_t shard_bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    const bool is_shard = entry.path().string().find("-of-") != std::string::npos;
    shard_bytes += is_shard ? entry.file_size() : 0;
  }
  EXPECT_NEAR(double(forecast->shard_bytes) / double(shard_bytes), 1, 0.5);
  EXPECT_NEAR(double(forecast->scene_bytes) / double(std::filesystem::file_size(out_)), 1, 0.35);
  // More shards need less memory and time each, and the merge as much
  const auto more = forecastIndexShards(inputs_, out_, options_, 12, progress_);
  ASSERT_TRUE(more.ok());
  EXPECT_LT(more->memory_bytes, forecast->memory_bytes);
  EXPECT_EQ(more->shard_bytes, forecast->shard_bytes);
}

TEST_F(IndexShards, BadRangesAndStreamsAreRefused) {
  writeInput("a.ply", sphereCloud(10));
  for (const ShardRange& range :
       {ShardRange{0, 1, 2}, ShardRange{2, 1, 2}, ShardRange{1, 3, 2}, ShardRange{1, 1, 0}}) {
    EXPECT_EQ(
        indexShards(inputs_, out_, options_, IndexPass::kCount, range, progress_).status().code(),
        StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(
      indexShards(inputs_, "-", options_, IndexPass::kCount, {1, 1, 2}, progress_).status().code(),
      StatusCode::kInvalidArgument);
  EXPECT_EQ(
      indexShards({"-"}, out_, options_, IndexPass::kCount, {1, 1, 2}, progress_).status().code(),
      StatusCode::kInvalidArgument);
  options_.cube = SceneCube{{0, 0, 0}, 0.5};
  for (int shard = 1; shard <= 2; ++shard) ASSERT_TRUE(pass(IndexPass::kCount, shard, 2).ok());
  const Status status = pass(IndexPass::kDistribute, 1, 2);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("of 10 surfels lie outside of the cube"));
}

TEST(IndexShardRanges, BeginWithCellsAndHaveEqualParts) {
  TestRandom random(3);
  std::vector<CurveKey> keys(20000);
  for (CurveKey& key : keys) {
    key = (CurveKey{random.bits()} << 31 | random.bits()) & ((CurveKey{1} << 63) - 1);
  }
  std::sort(keys.begin(), keys.end());
  const std::vector<CurveKey> splitters = chooseRanges(keys, 20'000'000, 16, kFreshSurfels);
  ASSERT_EQ(splitters.size(), 15u);
  for (std::size_t i = 0; i < splitters.size(); ++i) {
    EXPECT_EQ(splitters[i] % 8, 0u);
    const auto place = std::lower_bound(keys.begin(), keys.end(), splitters[i]) - keys.begin();
    EXPECT_NEAR(double(place), double(keys.size()) * double(i + 1) / 16, 20000. / 32 + 1);
  }
}

// Counted by brute force.
TEST(IndexShardRanges, JoinWhereSlabsGoOn) {
  const CurveKey top = CurveKey{1} << 60;  // a cell of level 1
  std::vector<CurveKey> keys;
  for (std::size_t i = 0; i < kFreshSurfels; ++i) keys.push_back(top + i);
  keys.push_back(2 * top + 5);
  keys.push_back(3 * top);
  // Behind enough, and one short of it
  const std::vector<CurveKey> splitters = {top + (CurveKey{1} << 57), 2 * top, 3 * top};
  RangeCounts counts(splitters);
  counts.add(std::span<const CurveKey>(keys).first(100));
  counts.add(std::span<const CurveKey>(keys).subspan(100));
  std::vector<RangeCounts::Joined> joined = counts.join(kFreshSurfels);
  ASSERT_EQ(joined.size(), 4u);
  EXPECT_EQ(joined[0].surfels, kFreshSurfels);
  EXPECT_EQ(joined[0].ends.begin_level, 0);
  EXPECT_EQ(joined[0].ends.end_level, 1);
  EXPECT_EQ(joined[1].surfels, 0u);
  EXPECT_EQ(joined[2].surfels, 1u);
  EXPECT_EQ(joined[2].ends.begin_level, 1);
  EXPECT_EQ(joined[3].ends.end_level, 0);
  RangeCounts fewer(splitters);
  keys.erase(keys.begin());
  fewer.add(std::span<const CurveKey>(keys));
  joined = fewer.join(kFreshSurfels);
  ASSERT_EQ(joined.size(), 2u);
  EXPECT_EQ(joined[0].surfels, kFreshSurfels);
  EXPECT_EQ(joined[0].last, 2);
  EXPECT_EQ(joined[1].surfels, 1u);
}

}  // namespace
}  // namespace surfeit
