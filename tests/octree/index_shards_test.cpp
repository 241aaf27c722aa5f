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

#include "index/shards/index_shard_file.h"
#include "index/shards/index_shard_ranges.h"
#include "octree/index_shards_fixture.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(IndexShards, AnyNumberOfThemHasTheBytesOfOneMachine) {
  const std::vector<Surfel> cloud = unevenCloud(isThreadSanitized() ? 200000 : 360000);
  writeInput("a.ply", std::span(cloud).first(cloud.size() / 3));
  writeInput("b.ply", std::span(cloud).subspan(cloud.size() / 3));
  for (const int count : {1, 2, 7}) {
    expectSameBytes(count, std::min(count, isThreadSanitized() ? 1 : 3));
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
