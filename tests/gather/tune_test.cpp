#include "surfeit/tune.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "gather/test_clouds.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

// A scene of some hundred pages and receivers on it.
class Tune : public ::testing::Test {
 protected:
  void makeClouds(int side, int receivers) {
    makeScene(floorAndSphere(side), scene_);
    writeTable(receiversOf(receivers), receivers_);
    options_.gather.threads = 2;
    options_.gather.memory_bytes = std::uint64_t{256} << 20;
    options_.gather.temporary_directory = directory_.file("");
  }
  TuneReport tune() {
    const Result<TuneReport> report = tuneGather(scene_, receivers_, options_, progress_);
    EXPECT_TRUE(report.ok()) << report.status().message();
    return report.ok() ? *report : TuneReport();
  }
  Status failure() { return tuneGather(scene_, receivers_, options_, progress_).status(); }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  TuneOptions options_;
  Progress progress_;
};

double missRate(const TuneCache& cache) { return 1 - cache.hitRate(); }

TEST_F(Tune, RowsRiseFromTheLeastToAllInMemory) {
  makeClouds(200, 2000);
  const TuneReport report = tune();
  ASSERT_GE(report.rows.size(), 3u);
  for (std::size_t i = 1; i < report.rows.size(); ++i) {
    const TuneRow &smaller = report.rows[i - 1], &larger = report.rows[i];
    EXPECT_GT(larger.memory_bytes, smaller.memory_bytes);
    EXPECT_GT(larger.cache_bytes, smaller.cache_bytes);
    EXPECT_LE(larger.predicted.seconds, smaller.predicted.seconds);
    EXPECT_LE(larger.predicted.bytesRead(), smaller.predicted.bytesRead() * 1.001);
  }
  EXPECT_EQ(report.rows.back().cache_bytes, report.decoded_cache_bytes);
  EXPECT_GT(report.curve.size(), 10u);
}

TEST_F(Tune, TheLeastRowIsTheLeastThatAGatherAccepts) {
  makeClouds(100, 500);
  const std::uint64_t least = tune().rows.front().memory_bytes;
  GatherOptions gather = options_.gather;
  gather.memory_bytes = least;
  const std::string result = directory_.file("result.ply");
  EXPECT_TRUE(gatherCloud(scene_, receivers_, result, gather, progress_).ok());
  gather.memory_bytes = least - 1;
  EXPECT_EQ(gatherCloud(scene_, receivers_, result, gather, progress_).status().code(),
            StatusCode::kBudgetTooSmall);
}

TEST_F(Tune, WithAllReceiversItForeseesTheLoadsOfAGather) {
  makeClouds(300, 3000);
  options_.sample_receivers = 0;
  options_.check = true;
  options_.gather.threads = 1;  // nothing but the receivers decides the order of look-ups
  options_.gather.prefetch = false;
  options_.gather.cache_split = 0.5;
  const TuneReport report = tune();
  EXPECT_EQ(report.sampled_receivers, 3000u);
  for (const TuneRow& row : report.rows) {
    ASSERT_TRUE(row.measured.has_value());
    EXPECT_EQ(row.predicted.node_cache.requests, row.measured->node_cache.requests);
    EXPECT_EQ(row.predicted.surfel_cache.requests, row.measured->surfel_cache.requests);
    // Fronts and resident pages make a cache of few frames other than plain LRU
    EXPECT_NEAR(row.predicted.node_cache.hitRate(), row.measured->node_cache.hitRate(), 0.02)
        << row.cache_bytes;
    EXPECT_NEAR(row.predicted.surfel_cache.hitRate(), row.measured->surfel_cache.hitRate(), 0.02)
        << row.cache_bytes;
  }
  // In the largest cache everything that is touched is read once
  const TuneRow& all = report.rows.back();
  EXPECT_NEAR(all.predicted.surfel_cache.loads, all.measured->surfel_cache.loads, 1);
  ASSERT_TRUE(report.hitRateError().has_value());
  EXPECT_LT(*report.hitRateError(), 1.0);
}

TEST_F(Tune, AQuarterOfTheReceiversForeseesNearlyTheSame) {
  makeClouds(300, 200000);
  options_.gather.cache_split = 0.5;
  options_.sample_receivers = 0;
  const TuneReport all = tune();
  options_.sample_receivers = 50000;
  const TuneReport quarter = tune();
  EXPECT_LE(quarter.sampled_receivers, 50000u);
  ASSERT_EQ(quarter.rows.size(), all.rows.size());
  for (std::size_t i = 0; i < all.rows.size(); ++i) {
    const TuneOutcome &expected = all.rows[i].predicted, &found = quarter.rows[i].predicted;
    EXPECT_NEAR(missRate(found.node_cache), missRate(expected.node_cache), 0.08) << i;
    EXPECT_NEAR(missRate(found.surfel_cache), missRate(expected.surfel_cache), 0.025) << i;
  }
  // What is read at least once is extrapolated, and in so small a scene from few packets
  const double all_read = all.rows.back().predicted.bytesRead();
  EXPECT_NEAR(quarter.rows.back().predicted.bytesRead(), all_read, 0.4 * all_read);
}

TEST_F(Tune, PredictedLoadsDependOnReceiversAndThreadsAlone) {
  makeClouds(200, 4000);
  options_.sample_receivers = 2000;
  options_.gather.cache_split = 0.5;
  options_.gather.threads = 3;
  const TuneReport one = tune(), two = tune();
  ASSERT_EQ(one.rows.size(), two.rows.size());
  for (std::size_t i = 0; i < one.rows.size(); ++i) {
    EXPECT_EQ(one.rows[i].predicted.node_cache.loads, two.rows[i].predicted.node_cache.loads);
    EXPECT_EQ(one.rows[i].predicted.surfel_cache.loads, two.rows[i].predicted.surfel_cache.loads);
  }
}

TEST_F(Tune, TheRecommendedBudgetIsNoSlowerAndNoLargerThanNeeded) {
  makeClouds(300, 3000);
  const TuneReport report = tune();
  const TuneRow& all = report.rows.back();
  EXPECT_LE(report.recommended.predicted.seconds,
            (1 + kTuneTimeMargin) * all.predicted.seconds * 1.0001);
  const std::uint64_t unit = std::uint64_t{1} << 20;
  EXPECT_LE(report.recommended.memory_bytes, all.memory_bytes + unit);
  EXPECT_EQ(report.recommended.memory_bytes % unit, 0u);
}

TEST_F(Tune, ItWritesNothingThatStays) {
  makeClouds(50, 100);
  options_.check = true;
  tune();
  EXPECT_TRUE(directory_.holdsOnly({"receivers.ply", "scene.sft"}));
}

TEST_F(Tune, OneReceiverIsASampleToo) {
  makeClouds(50, 1);
  EXPECT_EQ(tune().sampled_receivers, 1u);
}

TEST_F(Tune, FailuresNameWhatIsWrong) {
  makeClouds(50, 100);
  options_.gather.memory_bytes = 1000;
  EXPECT_EQ(failure().code(), StatusCode::kBudgetTooSmall);
  EXPECT_NE(failure().message().find("least that works"), std::string::npos);

  options_.gather.memory_bytes = std::uint64_t{256} << 20;
  Table none = receiversOf(0);
  writeTable(none, receivers_);
  EXPECT_EQ(failure().code(), StatusCode::kCorruption);
  EXPECT_NE(failure().message().find("expected at least one"), std::string::npos);

  std::filesystem::remove(receivers_);
  EXPECT_EQ(failure().code(), StatusCode::kIoError);
}

TEST_F(Tune, ItStopsWhenCancelled) {
  makeClouds(50, 100);
  class Cancelled : public Progress {
    bool isCancelled() const override { return true; }
  } cancelled;
  EXPECT_EQ(tuneGather(scene_, receivers_, options_, cancelled).status().code(),
            StatusCode::kInterrupted);
}

}  // namespace
}  // namespace surfeit
