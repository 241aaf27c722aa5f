// Indexing when the system refuses: every call of a whole run that spills fails in turn.
//
// Every call fails with EIO, every few calls with the other errors; with SURFEIT_FULL_SWEEP in the
// environment, every call with every error; under the thread sanitizer a fourth of them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "io/fault_injector.h"
#include "io/signal_storm.h"
#include "octree/spilling_index_test.h"

namespace surfeit {
namespace {

using Repeat = FailCall::Repeat;
using testing::HasSubstr;
using testing::IsEmpty;

// What disks, quotas and the limits of a process say, beside EIO.
constexpr int kOtherErrors[] = {ENOSPC, EDQUOT, EAGAIN, EMFILE};
constexpr int kMostCalls = 3000;  // more than any run here makes

bool isFullSweep() { return std::getenv("SURFEIT_FULL_SWEEP") != nullptr; }

enum class Names { kUnnamed, kNamed };  // whether a file has a name while it is written

struct FaultKind {
  int error = EIO;
  Repeat repeat = Repeat::kOnce;
  Names names = Names::kUnnamed;
  int stride = 1;  // of the calls that fail
  int first = 1;   // of them
};

class IndexFaultTest : public SpillingIndexTest {
 protected:
  // Fails call first, first + stride, ... until there is no such call.
  void sweep(const FaultKind& kind) {
    const int stride = isFullSweep() ? 1 : kind.stride * (isThreadSanitized() ? 4 : 1);
    for (int number = kind.first; number < kMostCalls; number += stride) {
      SCOPED_TRACE(testing::Message() << "call " << number << ", " << std::strerror(kind.error)
                                      << (kind.repeat == Repeat::kOnce ? ", once" : ", for ever"));
      FailCall fail(number, kind.error, kind.repeat);
      const Status status = indexWithFault(fail, kind.names);
      if (!fail.hasFailed()) {
        EXPECT_TRUE(status.ok()) << status.message();
        EXPECT_GT(number, kind.first);
        return;
      }
      checkOutcome(status, kind, fail);
      if (HasFailure()) return;
    }
    FAIL() << "the calls come to no end";
  }

  Status indexWithFault(FailCall& fail, Names names) {
    write("out/scene.sft", "old");
    const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
    const Status status = indexWith(fail, names);
    EXPECT_EQ(entryCount("/proc/self/fd"), descriptors);
    return status;
  }

  Status indexWith(FaultInjector& injector, Names names) {
    RefuseUnnamed refuse_unnamed;
    const Faults faults(names == Names::kNamed
                            ? std::initializer_list<FaultInjector*>{&refuse_unnamed, &injector}
                            : std::initializer_list<FaultInjector*>{&injector});
    return tryIndex().status();
  }

  void checkOutcome(const Status& status, const FaultKind& kind, const FailCall& fail) {
    EXPECT_TRUE(kind.error != EINTR || status.ok()) << status.message();
    if (status.ok()) {
      EXPECT_TRUE(contents("out/scene.sft") == expected_);
    } else {
      EXPECT_EQ(status.code(), StatusCode::kIoError) << status.message();
      EXPECT_THAT(status.message(), HasSubstr(directory_.string()));
      // Once the scene has its name, only the sync of its directory is left to fail
      if (status.message().find("sync the directory") == std::string::npos) {
        EXPECT_EQ(contents("out/scene.sft"), "old") << status.message();
      } else {
        EXPECT_TRUE(fail.failedCall() == Call::kFsync && contents("out/scene.sft") == expected_);
      }
    }
    // A system that refuses to remove a temporary file does so when the next run comes
    const bool may_refuse = kind.repeat == Repeat::kForEver || fail.failedCall() == Call::kUnlink;
    if (may_refuse && filesIn("out").size() + filesIn("temp").size() > 1) {
      EXPECT_FALSE(status.ok());
      CountCalls no_fault;
      EXPECT_TRUE(indexWith(no_fault, kind.names).ok());
    }
    EXPECT_EQ(filesIn("out").size(), 1u);
    EXPECT_THAT(filesIn("temp"), IsEmpty());
  }

  // A run with the injectors succeeds, and the scene is the same.
  void expectSameScene(std::initializer_list<FaultInjector*> injectors) {
    std::filesystem::remove(path("out/scene.sft"));
    {
      const Faults faults(injectors);
      const Result<IndexStats> stats = tryIndex();
      EXPECT_TRUE(stats.ok()) << stats.status().message();
    }
    EXPECT_TRUE(contents("out/scene.sft") == expected_);
    EXPECT_THAT(filesIn("temp"), IsEmpty());
  }
};

// Throws what a thread that cannot be started throws.
class ThrowingProgress : public Progress {
 public:
  explicit ThrowingProgress(std::string phase) : phase_(std::move(phase)) {}
  void beginPhase(std::string_view name, std::uint64_t, std::string_view) override {
    if (name == phase_) {
      throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
    }
  }

 private:
  const std::string phase_;
};

TEST_F(IndexFaultTest, ExceptionIsAFailureThatNamesTheOutput) {
  makeScene(randomCloud(5000));
  for (const char* phase : {"read", "build"}) {
    ThrowingProgress progress(phase);
    const Status status =
        indexClouds({path("in/cloud.ply")}, path("out/scene.sft"), options_, progress).status();
    EXPECT_EQ(status.code(), StatusCode::kFailed);
    EXPECT_EQ(status.message(), path("out/scene.sft") + ": Resource temporarily unavailable");
    EXPECT_TRUE(contents("out/scene.sft") == expected_);
    EXPECT_EQ(filesIn("out").size(), 1u);
    EXPECT_THAT(filesIn("temp"), IsEmpty());
  }
}

TEST_F(IndexFaultTest, EveryCallMayFail) {
  makeScene(randomCloud(5000));
  for (const Repeat repeat : {Repeat::kOnce, Repeat::kForEver}) {
    sweep({.error = EIO, .repeat = repeat});
    for (const int error : kOtherErrors) sweep({.error = error, .repeat = repeat, .stride = 3});
  }
  sweep({.error = EINTR});
}

TEST_F(IndexFaultTest, EveryCallMayFailWhereFilesHaveNames) {
  makeScene(randomCloud(5000));
  for (const Repeat repeat : {Repeat::kOnce, Repeat::kForEver}) {
    sweep({.error = EIO, .repeat = repeat, .names = Names::kNamed});
    for (const int error : kOtherErrors) {
      sweep({.error = error, .repeat = repeat, .names = Names::kNamed, .stride = 7});
    }
  }
}

// Hundreds of reads that are all alike
TEST_F(IndexFaultTest, EveryCallMayFailWhileASampleIsTaken) {
  makeScene(randomCloud(9000));
  sweep({.error = EIO});
  for (const int error : kOtherErrors) {
    sweep({.error = error, .repeat = Repeat::kForEver, .stride = 31});
  }
}

TEST_F(IndexFaultTest, EveryCallMayFailWithSeveralBuckets) {
  makeScene(randomCloud(2 * kOneBucket));
  sweep({.error = EIO, .stride = 293});
  sweep({.error = ENOSPC, .repeat = Repeat::kForEver, .stride = 293});
  // The last calls one by one: buckets, pages, and what ends a file
  CountCalls reads(readsBelow(path("in")));
  {
    const Faults faults({&reads});
    ASSERT_TRUE(tryIndex().ok());
  }
  sweep({.error = EIO, .first = reads.count()});
}

TEST_F(IndexFaultTest, EveryCallMayFailWhileSizesAreFound) {
  makeScene(randomCloud(5000), kPositionsOnly);
  for (const Repeat repeat : {Repeat::kOnce, Repeat::kForEver}) {
    sweep({.error = EIO, .repeat = repeat});
    for (const int error : kOtherErrors) sweep({.error = error, .repeat = repeat, .stride = 11});
  }
  sweep({.error = EIO, .names = Names::kNamed, .stride = 3});
}

TEST_F(IndexFaultTest, LostTemporaryFileIsAnErrorThatNamesItsDirectory) {
  makeScene(randomCloud(2 * kOneBucket));
  for (const Repeat repeat : {Repeat::kOnce, Repeat::kForEver}) {
    for (int number = 1;; number += 3) {
      FailCall fail(number, EIO, repeat, readsBelow(path("temp")));
      const Status status = indexWithFault(fail, Names::kUnnamed);
      if (!fail.hasFailed()) {
        EXPECT_GT(number, 5);
        break;
      }
      ASSERT_EQ(status.code(), StatusCode::kIoError);
      EXPECT_THAT(status.message(), HasSubstr(path("temp") + " (temporary file)"));
      EXPECT_EQ(contents("out/scene.sft"), "old");
    }
  }
}

TEST_F(IndexFaultTest, FullDiskIsAnErrorWhateverItsSize) {
  makeScene(randomCloud(5000));
  const std::uint64_t all = expected_.size() + 5000 * 64;
  for (const std::uint64_t bytes :
       {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{4096}, all / 8, all / 4, all / 3}) {
    for (const int error : {ENOSPC, EDQUOT}) {
      SCOPED_TRACE(bytes);
      write("out/scene.sft", "old");
      {
        FullDisk full(bytes, error);
        const Faults faults({&full});
        const Status status = tryIndex().status();
        ASSERT_EQ(status.code(), StatusCode::kIoError);
        EXPECT_THAT(status.message(), HasSubstr(std::strerror(error)));
      }
      EXPECT_EQ(contents("out/scene.sft"), "old");
      EXPECT_EQ(filesIn("out").size() + filesIn("temp").size(), 1u);
    }
  }
  expectSameScene({});
}

TEST_F(IndexFaultTest, FailedSyncIsFinal) {
  makeScene(randomCloud(5000));
  CountCalls syncs(only(Call::kFsync));
  FailCall fail(1, EIO, Repeat::kOnce, only(Call::kFsync));
  write("out/scene.sft", "old");
  {
    const Faults faults({&syncs, &fail});
    const Status status = tryIndex().status();
    EXPECT_EQ(status.code(), StatusCode::kIoError);
    EXPECT_THAT(status.message(), HasSubstr(path("out/scene.sft") + ": cannot sync"));
  }
  EXPECT_EQ(syncs.count(), 1);
  EXPECT_EQ(contents("out/scene.sft"), "old");
}

TEST_F(IndexFaultTest, ShortTransfersDoNotChangeTheScene) {
  for (const CloudChannels& channels : {kAllChannels, kPositionsOnly}) {
    makeScene(randomCloud(9000), channels);
    for (const std::size_t limit : {std::size_t{0}, std::size_t{4095}, std::size_t{100'000}}) {
      ShortTransfers shorten(limit);
      expectSameScene({&shorten});
    }
  }
  makeScene(randomCloud(500));
  ShortTransfers one_byte(1);
  expectSameScene({&one_byte});
}

TEST_F(IndexFaultTest, FileSystemsThatLackFeaturesDoNotChangeTheScene) {
  makeScene(randomCloud(9000));
  RefuseUnnamed refuse_unnamed;
  RefuseDirect refuse_opened(RefuseDirect::When::kOpened), refuse_used(RefuseDirect::When::kUsed);
  expectSameScene({&refuse_unnamed});
  expectSameScene({&refuse_opened});
  expectSameScene({&refuse_used, &refuse_unnamed});
}

TEST_F(IndexFaultTest, InterruptedCallsDoNotChangeTheScene) {
  for (const CloudChannels& channels : {kAllChannels, kPositionsOnly}) {
    makeScene(randomCloud(9000), channels);
    InterruptStorm storm;
    expectSameScene({&storm});
  }
}

TEST_F(IndexFaultTest, SignalsDoNotChangeTheScene) {
  makeScene(randomCloud(60000));
  const SignalStorm storm;
  for (int run = 0; run < 3; ++run) expectSameScene({});
  EXPECT_GT(storm.count(), 20);
}

}  // namespace
}  // namespace surfeit
