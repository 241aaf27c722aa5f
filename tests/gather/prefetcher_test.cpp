// Reading ahead, where reads are slow and caches are too small: it happens, and no result changes.
#include "batch/prefetcher.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <initializer_list>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "batch/gather_crew.h"
#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "gather/frames_gather.h"
#include "gather/test_clouds.h"
#include "io/fault_injector.h"
#include "octree/read/scene_file.h"

namespace surfeit {
namespace {

// A disk with a latency.
class SlowReads : public FaultInjector {
 public:
  int before(CallInfo& info) override {
    if (info.call == Call::kPread) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return 0;
  }
};

class PrefetchedGather : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(150), scene_);
    writeTable(receiversOf(kReceivers), receivers_);
  }

  // Gathers in caches of so many frames each; results by index. Calls of opening and sorting are
  // not slowed down.
  std::vector<GatherResult> gather(std::size_t frames, int threads, int prefetch_threads,
                                   GatherStats& stats, FaultInjector* reads = nullptr) {
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.quality.max_solid_angle = 0.3f;
    options.quality.raster_resolution = 4;
    std::vector<GatherResult> results(kReceivers);
    const Status status = gatherInFrames(
        {.scene = scene_,
         .receivers = receivers_,
         .temporary_directory = directory_.file(""),
         .options = options,
         .frames = frames,
         .threads = threads,
         .prefetch_threads = prefetch_threads,
         .fault = reads},
        stats, [&](const ResultStore::Entry& entry) { results[entry.index] = entry.result; });
    EXPECT_TRUE(status.ok()) << status.message();
    return results;
  }

  static constexpr std::uint64_t kReceivers = 8192;

 private:
  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
};

TEST_F(PrefetchedGather, HasTheBytesOfAGatherInMemory) {
  GatherStats in_memory;
  const std::vector<GatherResult> expected = gather(10000, 1, 0, in_memory);
  EXPECT_EQ(in_memory.node_cache.evictions + in_memory.surfel_cache.evictions, 0u);

  // Long enough for the controller to see the stalls of its first quarter of a second
  SlowReads reads;
  GatherStats stats;
  const std::vector<GatherResult> found = gather(24, 2, Prefetcher::kThreads, stats, &reads);
  EXPECT_GT(stats.node_cache.prefetches + stats.surfel_cache.prefetches, 0u);
  EXPECT_GT(stats.node_cache.repeated_loads, 0u);
  EXPECT_GT(stats.surfel_cache.repeated_loads, 0u);
  for (const GatherWindow& window : stats.windows) {
    EXPECT_EQ(window.run_receivers, PagingController::kLeastRun);
  }
  EXPECT_EQ(std::memcmp(found.data(), expected.data(), kReceivers * sizeof(GatherResult)), 0);
}

}  // namespace
}  // namespace surfeit
