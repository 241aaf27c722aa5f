// An index by shards whose sizes and normals follow from neighbours: the merge has the bytes of one
// machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "octree/index_shards_fixture.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

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

TEST_F(IndexShardsWithNeighbours, AnyNumberOfThemHasTheBytesOfOneMachine) {
  const std::vector<Surfel> cloud = bareCloud(isThreadSanitized() ? 160000 : 360000);
  writeInput("a.ply", std::span(cloud).first(cloud.size() / 3), kPositionsOnly);
  writeInput("b.ply", std::span(cloud).subspan(cloud.size() / 3), kPositionsOnly);
  for (const int count : {1, 2, 7}) {
    expectSameBytes(count, std::min(count, isThreadSanitized() ? 1 : 3));
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

TEST_F(IndexShardsWithNeighbours, AreasAloneHaveTheBytesOfOneMachine) {
  std::vector<Surfel> cloud = bareCloud(60000);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud[i].area = 1e-3f * float(1 + i % 3);
  writeInput("a.ply", cloud, {.normal = true, .area = true});
  for (const int count : {2, 5}) expectSameBytes(count);
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

}  // namespace
}  // namespace surfeit
