// Gathers whose caches are far too small, from files that fail: nothing hangs, no result changes,
// and errors say what and where.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <initializer_list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "batch/gather_crew.h"
#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "gather/frames_gather.h"
#include "gather/test_clouds.h"
#include "io/fault_injector.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

GatherOptions coarse() {
  GatherOptions options;
  options.quality.max_solid_angle = 0.3f;
  options.quality.raster_resolution = 4;
  options.threads = 2;
  options.memory_bytes = std::uint64_t{1} << 30;
  return options;
}

// Keeps what it is told.
class NotedProgress : public Progress {
 public:
  void inform(const std::string& message) override { note(message); }
  void note(const std::string& message) override {
    const std::lock_guard lock(mutex_);
    notes_.push_back(message);
  }
  int notesWith(const std::string& text) const {
    int count = 0;
    for (const std::string& note : notes_) count += note.find(text) != std::string::npos ? 1 : 0;
    return count;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> notes_;
};

class GatherPaging : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(150), scene_);
    writeTable(receiversOf(kReceivers), receivers_);
  }

  Result<GatherStats> gather(const GatherOptions& options) {
    return gatherCloud(scene_, receivers_, result_, options, progress_);
  }
  std::uint64_t leastBudget(int threads) {
    const Result<SceneFile> scene = SceneFile::open(scene_);
    const Result<GatherInput> input = GatherInput::open(receivers_);
    EXPECT_TRUE(scene.ok() && input.ok());
    GatherOptions options = coarse();
    options.threads = threads;
    return leastGatherMemory(*scene, gatherWork(input->receivers(), options));
  }

  // Gathers with caches of so many frames each, whatever a plan would say; results by index. Calls
  // of the gather itself, not those of opening and sorting, may fail.
  Result<std::map<std::uint64_t, float>> gatherInFrames(std::size_t frames, int threads,
                                                        int prefetch_threads,
                                                        FaultInjector* fault = nullptr) {
    GatherStats stats;
    std::map<std::uint64_t, float> occlusion;
    SURFEIT_RETURN_IF_ERROR(surfeit::gatherInFrames({.scene = scene_,
                                                     .receivers = receivers_,
                                                     .temporary_directory = directory_.file(""),
                                                     .options = coarse(),
                                                     .frames = frames,
                                                     .threads = threads,
                                                     .prefetch_threads = prefetch_threads,
                                                     .fault = fault},
                                                    stats, [&](const ResultStore::Entry& entry) {
                                                      occlusion[entry.index] =
                                                          entry.result.occlusion;
                                                    }));
    return occlusion;
  }

  static constexpr std::uint64_t kReceivers = 600;
  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  NotedProgress progress_;
};

TEST_F(GatherPaging, HowPagesAreReadDoesNotChangeTheResult) {
  const std::uint64_t least = leastBudget(2) + (512 << 10);
  for (const ReceiverOrder order :
       {ReceiverOrder::kHilbert, ReceiverOrder::kMorton, ReceiverOrder::kInput}) {
    GatherOptions all_in_memory = coarse();
    all_in_memory.order = order;  // decides which receivers share a packet
    ASSERT_TRUE(gather(all_in_memory).ok());
    const std::string expected = readBytes(result_);
    for (const double split : {-1.0, 0.0, 0.3, 1.0}) {
      for (const bool direct : {false, true}) {
        GatherOptions options = coarse();
        options.memory_bytes = least;
        options.order = order;
        options.cache_split = split;
        options.direct_io = direct;
        options.prefetch = direct;
        const auto stats = gather(options);
        ASSERT_TRUE(stats.ok()) << stats.status().message();
        EXPECT_GT(stats->surfel_cache.evictions + stats->node_cache.evictions, 0u);
        EXPECT_TRUE(readBytes(result_) == expected) << split << direct;
      }
    }
  }
}

TEST_F(GatherPaging, PinnedSplitsAreKept) {
  GatherOptions options = coarse();
  options.memory_bytes = leastBudget(2) + (1 << 20);
  options.cache_split = 0.25;
  const auto few = gather(options);
  ASSERT_TRUE(few.ok()) << few.status().message();
  options.cache_split = 0.75;
  const auto many = gather(options);
  ASSERT_TRUE(many.ok()) << many.status().message();
  EXPECT_GT(many->node_cache.budget_bytes, 2 * few->node_cache.budget_bytes);
  EXPECT_LT(many->surfel_cache.budget_bytes, few->surfel_cache.budget_bytes);
}

TEST_F(GatherPaging, WindowsAddUpToTheWhole) {
  GatherOptions options = coarse();
  options.memory_bytes = leastBudget(2);
  const auto stats = gather(options);
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  ASSERT_FALSE(stats->windows.empty());
  GatherCacheStats sum;
  std::uint64_t receivers = 0;
  double end = 0;
  for (const GatherWindow& window : stats->windows) {
    EXPECT_EQ(window.begin_seconds, end);
    EXPECT_GE(window.end_seconds, window.begin_seconds);
    end = window.end_seconds;
    receivers += window.receivers;
    for (const auto count : {&GatherCacheStats::requests, &GatherCacheStats::hits,
                             &GatherCacheStats::misses, &GatherCacheStats::evictions,
                             &GatherCacheStats::repeated_loads, &GatherCacheStats::bytes_read}) {
      sum.*count += window.node_cache.*count;
    }
  }
  const GatherCacheStats& nodes = stats->node_cache;
  EXPECT_EQ(receivers, kReceivers);
  EXPECT_EQ(sum.requests, nodes.requests);
  EXPECT_EQ(sum.hits, nodes.hits);
  EXPECT_EQ(nodes.hits, nodes.front_hits + nodes.shared_hits);
  EXPECT_EQ(nodes.requests, nodes.hits + nodes.misses);
  EXPECT_EQ(sum.misses, nodes.misses);
  EXPECT_EQ(sum.evictions, nodes.evictions);
  EXPECT_EQ(sum.repeated_loads, nodes.repeated_loads);
  EXPECT_GT(nodes.stall_seconds, 0);
  EXPECT_GT(nodes.load_seconds, 0);
}

TEST_F(GatherPaging, ABudgetThatIsTooSmallIsToldOnceWithWhatWouldDo) {
  GatherOptions options = coarse();
  options.order = ReceiverOrder::kInput;  // no order at all: pages are read again and again
  options.memory_bytes = leastBudget(2);
  ASSERT_TRUE(gather(options).ok());
  EXPECT_EQ(progress_.notesWith("would do"), 1);
  options.memory_bytes = std::uint64_t{1} << 30;
  ASSERT_TRUE(gather(options).ok());
  EXPECT_EQ(progress_.notesWith("would do"), 1);
}

TEST_F(GatherPaging, CachesOfOnePageAndEightThreadsEndWithTheSameResult) {
  const auto expected = gatherInFrames(10000, 1, 0);
  ASSERT_TRUE(expected.ok()) << expected.status().message();
  ASSERT_EQ(expected->size(), kReceivers);
  for (const std::size_t frames : {1, 2, 7}) {
    const auto found = gatherInFrames(frames, 8, 1);
    ASSERT_TRUE(found.ok()) << found.status().message();
    EXPECT_TRUE(*found == *expected) << frames << " frames";
  }
}

TEST_F(GatherPaging, ReadErrorsReachTheCallerWithFilePageAndCause) {
  for (const std::size_t frames : {1, 20}) {
    for (const int number : {1, 8, 40, 200}) {
      FailCall fault(number, EIO, FailCall::Repeat::kForEver, only(Call::kPread));
      const auto result = gatherInFrames(frames, 8, 1, &fault);
      ASSERT_FALSE(result.ok()) << number;
      EXPECT_EQ(result.status().code(), StatusCode::kIoError) << result.status().message();
      EXPECT_THAT(result.status().message(), testing::HasSubstr("scene.sft"));
      EXPECT_THAT(result.status().message(), testing::HasSubstr("page "));
      EXPECT_THAT(result.status().message(), testing::HasSubstr("Input/output error"));
    }
  }
}

TEST_F(GatherPaging, ReadErrorsOfAnyCallLeaveNoResult) {
  GatherOptions options = coarse();
  options.threads = 8;
  options.memory_bytes = leastBudget(8);
  for (int number = 1; number < 60; number += 7) {
    FailCall fault(number, EIO, FailCall::Repeat::kForEver, only(Call::kPread));
    Faults faults{&fault};
    const auto stats = gather(options);
    ASSERT_FALSE(stats.ok()) << number;
    EXPECT_EQ(stats.status().code(), StatusCode::kIoError) << stats.status().message();
    EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply"}));
  }
}

}  // namespace
}  // namespace surfeit
