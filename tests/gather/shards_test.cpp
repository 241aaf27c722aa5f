// A gather by shards: the merge has the bytes of one gather, whatever was stopped, lost or damaged
// in between.
#include "surfeit/shards.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "batch/shard_file.h"
#include "batch/shard_plan.h"
#include "gather/test_clouds.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"

namespace surfeit {
namespace {

using testing::HasSubstr;
using testing::Not;

// Cancels once so many receivers have been gathered.
class StoppedGather : public Progress {
 public:
  explicit StoppedGather(std::uint64_t receivers) : left_(std::int64_t(receivers)) {}
  void beginPhase(std::string_view name, std::uint64_t, std::string_view) override {
    is_gather_ = name == "gather";
  }
  void advance(std::uint64_t count) override {
    if (is_gather_) left_ -= std::int64_t(count);
  }
  bool isCancelled() const override { return left_ <= 0; }

 private:
  std::atomic<bool> is_gather_{false};
  std::atomic<std::int64_t> left_;
};

class NoteList : public Progress {
 public:
  void note(const std::string& message) override { text += message + "\n"; }
  void inform(const std::string& message) override { text += message + "\n"; }
  std::string text;
};

GatherOptions coarseOptions() {
  GatherOptions options;
  options.quality.max_solid_angle = 0.3f;
  options.quality.raster_resolution = 4;
  options.threads = 2;
  options.memory_bytes = 256 << 20;
  return options;
}

class Shards : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(40), scene_);
    writeTable(receiversOf(3000), receivers_);
  }

  Status gatherShard(int shard, int count, Progress& progress, const GatherOptions& options) {
    return gatherShards(scene_, receivers_, result_, options, {shard, shard, count}, progress)
        .status();
  }
  Status gatherShard(int shard, int count, const GatherOptions& options = coarseOptions()) {
    return gatherShard(shard, count, notes_, options);
  }
  void gatherAll(int count, const GatherOptions& options = coarseOptions()) {
    for (int shard = 1; shard <= count; ++shard) {
      const Status status = gatherShard(shard, count, options);
      ASSERT_TRUE(status.ok()) << status.message();
    }
  }
  Status merge(int count = 0, bool removes = false) {
    MergeOptions options;
    options.memory_bytes = 256 << 20;
    options.threads = 2;
    options.count = count;
    options.removes_shards = removes;
    return mergeShards(scene_, receivers_, result_, options, notes_).status();
  }
  // Merges, and expects the bytes of one gather.
  void expectSameBytes(const GatherOptions& options = coarseOptions(), int count = 0) {
    const auto one = gatherCloud(scene_, receivers_, directory_.file("one.ply"), options, notes_);
    ASSERT_TRUE(one.ok()) << one.status().message();
    const Status merged = merge(count);
    ASSERT_TRUE(merged.ok()) << merged.message();
    EXPECT_EQ(readBytes(result_), readBytes(directory_.file("one.ply")));
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  NoteList notes_;
};

class PhaseCount : public Progress {
 public:
  void beginPhase(std::string_view name, std::uint64_t, std::string_view) override {
    ++counts[std::string(name)];
  }
  std::map<std::string, int> counts;
};

TEST_F(Shards, ThePlanIsMadeOnce) {
  PhaseCount phases;
  for (int shard = 1; shard <= 4; ++shard) {
    ASSERT_TRUE(gatherShard(shard, 4, phases, coarseOptions()).ok());
  }
  EXPECT_EQ(phases.counts["plan shards"], 1);
  EXPECT_EQ(phases.counts["sort"], 5);
}

TEST_F(Shards, AnyNumberOfThemHasTheBytesOfOneGather) {
  for (const int count : {1, 2, 7, 64}) {
    SCOPED_TRACE(count);
    gatherAll(count);
    expectSameBytes(coarseOptions(), count);
    ASSERT_TRUE(merge(count, /* removes= */ true).ok());
    EXPECT_TRUE(directory_.holdsOnly({"one.ply", "receivers.ply", "result.ply", "scene.sft"}));
  }
}

// Receivers along a line, so that each shard has rows in a few blocks.
TEST_F(Shards, RowsOfOthersAreNotRead) {
  Table receivers = receiversOf(20'000);
  for (std::size_t i = 0; i < receivers.rows.size(); ++i) {
    receivers.rows[i][0] = -1 + 2 * double(i) / double(receivers.rows.size());
    receivers.rows[i][1] = 0.1;
  }
  writeTable(receivers, receivers_);
  gatherAll(5);
  expectSameBytes();
  EXPECT_THAT(notes_.text, Not(HasSubstr("gathered again")));

  // A change shows to the shard that has it, and to the merge
  receivers.rows.back()[2] += 0.001;
  writeTable(receivers, receivers_);
  ASSERT_TRUE(gatherShard(1, 5).ok());
  EXPECT_THAT(notes_.text, Not(HasSubstr("gathered again")));
  EXPECT_THAT(std::string(merge().message()), HasSubstr("gather the shards again"));
  ASSERT_TRUE(gatherShard(5, 5).ok());
  EXPECT_THAT(notes_.text, HasSubstr("gathered again"));
  gatherAll(5);
  expectSameBytes();
}

// An invalid receiver in rows of another shard, which a task that is not strict passes over.
TEST_F(Shards, StrictOnesReadAllRows) {
  Table receivers = receiversOf(20'000);
  for (std::size_t i = 0; i < receivers.rows.size(); ++i) {
    receivers.rows[i][0] = -1 + 2 * double(i) / double(receivers.rows.size());
  }
  receivers.rows.back()[1] = std::numeric_limits<double>::quiet_NaN();
  writeTable(receivers, receivers_);
  ASSERT_TRUE(gatherShard(1, 5).ok());
  ASSERT_TRUE(gatherShard(2, 5).ok());
  EXPECT_THAT(notes_.text, HasSubstr("no result (NaN) at invalid receivers: 1"));
  GatherOptions strict = coarseOptions();
  strict.strict = true;
  EXPECT_THAT(std::string(gatherShard(3, 5, strict).message()), HasSubstr("record 19999"));
}

TEST_F(Shards, EveryOrderModeAndInterpolationHaveTheBytesOfOneGather) {
  GatherOptions morton = coarseOptions(), input = coarseOptions(), varied = coarseOptions();
  morton.order = ReceiverOrder::kMorton;
  morton.mode = GatherMode::kBleeding;
  input.order = ReceiverOrder::kInput;
  input.outputs = kOutputOcclusion | kOutputBentNormal;
  varied.quality.max_variation = 0.1f;
  for (const GatherOptions& options : {morton, input, varied}) {
    gatherAll(3, options);
    expectSameBytes(options);
  }
}

// What the gather needs and the merge does not: a viewpoint, a picture of light, a falloff.
TEST_F(Shards, MergesNeedNoOptionsOfTheGather) {
  GatherOptions glossy = coarseOptions(), sky = coarseOptions(), falloff = coarseOptions();
  glossy.mode = GatherMode::kGlossy;
  glossy.eye = {3, -4, 2};
  sky.mode = GatherMode::kBleeding;
  sky.environment.path = directory_.file("sky.hdr");
  std::string picture = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
  for (int i = 0; i < 32; ++i)
    picture += std::string{char(80 + 3 * i), char(60 + i), 40, char(129)};
  std::ofstream(sky.environment.path, std::ios::binary) << picture;
  falloff.weights.falloff = 1;
  falloff.quality.max_distance = 2;
  falloff.weights.falloff_mode = GatherWeights::FalloffMode::kPolynomial;
  for (const GatherOptions& options : {glossy, sky, falloff}) {
    gatherAll(3, options);
    expectSameBytes(options);
  }
}

TEST_F(Shards, InvalidReceiversStayWithoutResult) {
  Table receivers = receiversOf(2000);
  for (std::size_t i = 0; i < 2000; i += 9) {
    receivers.rows[i][0] = std::numeric_limits<double>::quiet_NaN();
  }
  writeTable(receivers, receivers_);
  gatherAll(4);
  expectSameBytes();
}

TEST_F(Shards, ThreadsAndMemoryMayDiffer) {
  GatherOptions other = coarseOptions();
  other.threads = 1;
  other.memory_bytes = 64 << 20;
  ASSERT_TRUE(gatherShard(1, 3, other).ok());
  ASSERT_TRUE(gatherShard(2, 3).ok());
  ASSERT_TRUE(gatherShard(3, 3, other).ok());
  expectSameBytes();
}

TEST_F(Shards, MissingOnesAreNamedWithTheirStatus) {
  gatherAll(12);
  for (const int shard : {2, 5, 6, 7, 12}) std::filesystem::remove(shardPath(result_, shard, 12));
  const Status status = merge();
  EXPECT_EQ(status.code(), StatusCode::kIncomplete);
  EXPECT_THAT(status.message(), HasSubstr("2, 5-7, 12 of 12 are missing"));
  EXPECT_THAT(status.message(), HasSubstr("--array=2,5-7,12"));
  EXPECT_FALSE(std::filesystem::exists(result_));
}

TEST_F(Shards, NoneAtAllIsIncomplete) {
  EXPECT_EQ(merge().code(), StatusCode::kIncomplete);
  EXPECT_EQ(merge(3).code(), StatusCode::kIncomplete);
}

TEST_F(Shards, SeveralJobsAreTold) {
  gatherAll(2);
  gatherAll(3);
  const Status status = merge();
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("--shards 2-3"));
  expectSameBytes(coarseOptions(), 3);
}

TEST_F(Shards, FinishedOnesAreSkipped) {
  gatherAll(2);
  const auto written = std::filesystem::last_write_time(shardPath(result_, 1, 2));
  const auto stats = gatherShards(scene_, receivers_, result_, coarseOptions(), {1, 2, 2}, notes_);
  ASSERT_TRUE(stats.ok());
  EXPECT_EQ(stats->finished_shards, 2);
  EXPECT_EQ(stats->gathered_shards, 0);
  EXPECT_EQ(std::filesystem::last_write_time(shardPath(result_, 1, 2)), written);
}

TEST_F(Shards, OtherOptionsMakeAnotherJob) {
  gatherAll(2);
  GatherOptions other = coarseOptions();
  other.quality.bias = 0.5f;
  ASSERT_TRUE(gatherShard(1, 2, other).ok());
  EXPECT_THAT(notes_.text, HasSubstr("settings/bias"));
  EXPECT_EQ(merge().code(), StatusCode::kIncomplete);
  ASSERT_TRUE(gatherShard(2, 2, other).ok());
  expectSameBytes(other);
}

TEST_F(Shards, OtherReceiversMakeAnotherJob) {
  gatherAll(2);
  Table receivers = receiversOf(3000);
  receivers.rows[17][0] += 0.25;
  writeTable(receivers, receivers_);
  const Status stale = merge();
  EXPECT_EQ(stale.code(), StatusCode::kCorruption);
  EXPECT_THAT(stale.message(), HasSubstr("receivers.ply"));
  EXPECT_FALSE(std::filesystem::exists(result_));
  gatherAll(2);
  expectSameBytes();
}

TEST_F(Shards, AnotherSceneIsRefused) {
  gatherAll(2);
  makeScene(floorAndSphere(41), scene_);
  const Status status = merge();
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("another scene"));
}

TEST_F(Shards, DamagedOnesAreGatheredAgain) {
  gatherAll(3);
  const std::string path = shardPath(result_, 2, 3), whole = readBytes(path);
  for (std::size_t at = 0; at < whole.size(); at += at < 1200 ? 7 : 997) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(path, std::ios::binary) << damaged;
    ASSERT_EQ(merge().code(), StatusCode::kIncomplete) << "byte " << at;
    std::ofstream(path, std::ios::binary) << whole.substr(0, at);
    ASSERT_EQ(merge().code(), StatusCode::kIncomplete) << "cut at " << at;
  }
  ASSERT_TRUE(gatherShard(2, 3).ok());
  EXPECT_THAT(notes_.text, HasSubstr("gathered again"));
  expectSameBytes();
}

TEST_F(Shards, ADamagedPlanIsMadeAgain) {
  gatherAll(3);
  const std::string path = result_ + ".shards-of-3", whole = readBytes(path);
  for (std::size_t at = 0; at < whole.size(); at += 5) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x01);
    std::ofstream(path, std::ios::binary) << damaged;
    const auto plan = readShardPlan(path, 3);
    ASSERT_TRUE(plan.ok());
    ASSERT_FALSE(plan->has_value()) << "byte " << at;
  }
  ASSERT_TRUE(gatherShard(1, 3).ok());
  EXPECT_EQ(readBytes(path), whole);
  expectSameBytes();
}

TEST_F(Shards, TheirPlanDoesNotDependOnThreadsAndMemory) {
  GatherOptions other = coarseOptions();
  other.threads = 1;
  other.memory_bytes = 48 << 20;
  ASSERT_TRUE(gatherShard(1, 5).ok());
  const std::string path = result_ + ".shards-of-5", plan = readBytes(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(gatherShard(4, 5, other).ok());
  EXPECT_EQ(readBytes(path), plan);
}

// The first half of the receivers lie far above the scene, where a cut is a node or two.
TEST_F(Shards, EqualCostIsNotEqualNumbers) {
  Table receivers = receiversOf(40000);
  for (std::size_t i = 0; i < 20000; ++i) receivers.rows[i][2] += 1000;
  writeTable(receivers, receivers_);
  GatherOptions options = coarseOptions();
  options.order = ReceiverOrder::kInput;
  ASSERT_TRUE(gatherShard(1, 2, options).ok());
  const auto plan = readShardPlan(result_ + ".shards-of-2", 2);
  ASSERT_TRUE(plan.ok() && plan->has_value());
  const std::uint64_t first = (*plan)->results(1), second = (*plan)->results(2);
  EXPECT_EQ(first + second, 40000u);
  EXPECT_GT(first, 25000u);
}

TEST_F(Shards, AStoppedGatherGoesOn) {
  writeTable(receiversOf(12000), receivers_);
  const GatherOptions options = coarseOptions();
  StoppedGather stopped(5000);
  const Status interrupted =
      gatherResumable(scene_, receivers_, result_, options, 8, stopped).status();
  EXPECT_EQ(interrupted.code(), StatusCode::kInterrupted);
  EXPECT_FALSE(std::filesystem::exists(result_));
  const auto stats = gatherResumable(scene_, receivers_, result_, options, 8, notes_);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_GE(stats->finished_shards, 2);
  EXPECT_LT(stats->finished_shards, 8);
  ASSERT_TRUE(gatherCloud(scene_, receivers_, directory_.file("one.ply"), options, notes_).ok());
  EXPECT_EQ(readBytes(result_), readBytes(directory_.file("one.ply")));
  EXPECT_TRUE(directory_.holdsOnly({"one.ply", "receivers.ply", "result.ply", "scene.sft"}));
}

TEST_F(Shards, ImpossibleRangesAreRefused) {
  for (const ShardRange range :
       {ShardRange{0, 1, 2}, {1, 3, 2}, {2, 1, 2}, {1, 1, 0}, {1, 1, kMostShards + 1}}) {
    EXPECT_EQ(
        gatherShards(scene_, receivers_, result_, coarseOptions(), range, notes_).status().code(),
        StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(
      gatherShards(scene_, receivers_, "-", coarseOptions(), {1, 1, 2}, notes_).status().code(),
      StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
