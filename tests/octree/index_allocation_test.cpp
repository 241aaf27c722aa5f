// Indexing when memory is refused: each allocation of a whole run in turn, in a process of its own.
// Replaces operator new.
//
// Allocations fail one by one up to a number, and then at ever larger steps; with
// SURFEIT_FULL_SWEEP in the environment all of them. TBB's own are let through: when one fails,
// it waits for ever in a destructor. What zstd and the system's library ask malloc for is not among
// them.
//
// The destructor of a JSON value of nlohmann's library allocates, and the program ends when it
// cannot: those few are counted, and bounded.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "failing_allocations.h"
#include "io/fault_injector.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

enum Outcome : int { kSound, kRefused, kWrong, kTerminated };

bool isOfTbb(const void* code) {
  Dl_info info;
  return ::dladdr(code, &info) != 0 && std::strstr(info.dli_fname, "libtbb") != nullptr;
}

// What `work` returns in a process of its own; kWrong when it crashes.
int inChild(const std::function<Outcome()>& work) {
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    std::set_terminate([] { ::_exit(kTerminated); });
    ::_exit(work());
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : int{kWrong};
}

class IndexAllocationTest : public SceneTest {
 protected:
  void SetUp() override {
    SceneTest::SetUp();
    std::filesystem::create_directory(directory_ / "out");
    options_.threads = 2;
    options_.temporary_directory = path("out");
    is_spared = isOfTbb;
    inputs_ = {path("cloud.ply")};
    output_ = path("out/scene.sft");
  }

  Status tryIndex() { return indexClouds(inputs_, output_, options_, quiet_).status(); }

  // The allocations of a run that works, which leaves its scene.
  long countAllocations() {
    const std::string told = path("count");
    EXPECT_EQ(inChild([&] {
                constexpr long kPlenty = 1'000'000'000;
                allocations_until_failure = kPlenty;
                const bool ok = tryIndex().ok();
                const long used = kPlenty - allocations_until_failure.exchange(-1);
                std::ofstream(told) << used;
                return ok ? kSound : kWrong;
              }),
              kSound);
    long used = 0;
    std::ifstream(told) >> used;
    return used;
  }

  Outcome outcome(long number, bool for_ever, const std::string& expected) {
    const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
    Status status;
    {
      const FailingAllocations failing(number, for_ever);
      try {
        status = tryIndex();
      } catch (...) {
        return kWrong;
      }
    }
    // What fails once the scene has its name leaves it there
    const std::string found = contents("out/scene.sft");
    const bool is_kept = found == expected || (found == "old" && !status.ok());
    const auto files = std::distance(std::filesystem::directory_iterator(directory_ / "out"),
                                     std::filesystem::directory_iterator());
    if (!is_kept || files != 1 || entryCount("/proc/self/fd") != descriptors) return kWrong;
    if (!status.ok() && status.message().find("out of memory") == std::string::npos) return kWrong;
    return status.ok() ? kSound : kRefused;
  }

  void sweep(const CloudChannels& channels, std::size_t surfels) {
    writeCloud(path("cloud.ply"), randomCloud(surfels), channels);
    const long all = countAllocations();
    const std::string expected = contents("out/scene.sft");
    ASSERT_GT(all, 500);
    const bool is_full = std::getenv("SURFEIT_FULL_SWEEP") != nullptr;
    int counts[kTerminated + 1] = {};
    for (const bool for_ever : {false, true}) {
      for (long number = 0; number < all; number += is_full || number < 100 ? 1 : 1 + number / 50) {
        write("out/scene.sft", "old");
        const int found = inChild([&] { return outcome(number, for_ever, expected); });
        ASSERT_NE(found, kWrong) << "allocation " << number << (for_ever ? " and all later" : "");
        ++counts[found];
      }
    }
    std::printf("%ld allocations: %d refused with a message, %d sound, %d terminated\n", all,
                counts[kRefused], counts[kSound], counts[kTerminated]);
    EXPECT_GT(counts[kRefused], 9 * (counts[kSound] + counts[kTerminated]));
    EXPECT_LT(counts[kTerminated], counts[kRefused] / 10);
  }

  // No call of the test's own allocates meanwhile
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
