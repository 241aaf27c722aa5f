// Indexing when memory is refused: each allocation of a whole run in turn. A program of its own, as
// it replaces operator new.
//
// Allocations fail one by one up to a number, and then at ever larger steps; with
// SURFEIT_FULL_SWEEP in the environment all of them, once and for ever. What zstd, TBB and the
// system's library ask malloc for is not among them.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "failing_allocations.h"
#include "io/fault_injector.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

class IndexAllocationTest : public SceneTest {
 protected:
  void SetUp() override {
    SceneTest::SetUp();
    std::filesystem::create_directory(directory_ / "out");
    options_.threads = 2;
    options_.temporary_directory = path("out");
    inputs_ = {path("cloud.ply")};
    output_ = path("out/scene.sft");
  }

  Status tryIndex() { return indexClouds(inputs_, output_, options_, quiet_).status(); }

  // The allocations of a run that works.
  long count() {
    constexpr long kPlenty = 1'000'000'000;
    const FailingAllocations counting(kPlenty, false);
    EXPECT_TRUE(tryIndex().ok());
    return kPlenty - allocations_until_failure;
  }

  void sweep(const CloudChannels& channels, std::size_t surfels) {
    writeCloud(path("cloud.ply"), randomCloud(surfels), channels);
    ASSERT_TRUE(tryIndex().ok());  // what a thread keeps is there from now on
    const std::string expected = contents("out/scene.sft");
    const long all = count();
    const bool is_full = std::getenv("SURFEIT_FULL_SWEEP") != nullptr;
    long tried = 0, failed = 0;
    for (const bool for_ever : {false, true}) {
      // Threads of a run before may have kept memory or not: a few more than were counted
      for (long number = 0; number < all + all / 10;
           number += is_full || number < 300 ? 1 : 1 + number / 100) {
        SCOPED_TRACE(testing::Message() << "allocation " << number << " of " << all);
        write("out/scene.sft", "old");
        const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
        Status status;
        {
          const FailingAllocations failing(number, for_ever);
          status = tryIndex();
          // Some have another way without memory: then the scene is as it should be
          failed += failing.anyFailed() && !status.ok() ? 1 : 0;
        }
        ++tried;
        ASSERT_TRUE(contents("out/scene.sft") == (status.ok() ? expected : "old"))
            << status.message();
        ASSERT_EQ(entryCount("/proc/self/fd"), descriptors);
        ASSERT_EQ(std::distance(std::filesystem::directory_iterator(directory_ / "out"),
                                std::filesystem::directory_iterator()),
                  1);
      }
    }
    std::printf("%ld allocations, %ld tried, %ld made an error\n", all, tried, failed);
    EXPECT_GT(failed, tried / 2);
    ASSERT_TRUE(tryIndex().ok());
    EXPECT_TRUE(contents("out/scene.sft") == expected);
  }

  // No call of the test's own allocates
  IndexOptions options_;
  std::vector<std::string> inputs_;
  std::string output_;
  Progress quiet_;
};

TEST_F(IndexAllocationTest, EveryAllocationMayFail) { sweep(kAllChannels, 2000); }

TEST_F(IndexAllocationTest, EveryAllocationMayFailWhileSizesAreFound) {
  sweep(kPositionsOnly, 1000);
}

}  // namespace
}  // namespace surfeit
