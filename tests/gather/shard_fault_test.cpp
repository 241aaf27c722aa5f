// Shards whose system calls fail: an error that names the place, and the next try goes on to the
// bytes of one gather.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <functional>
#include <string>

#include "gather/test_clouds.h"
#include "io/fault_injector.h"
#include "surfeit/bake.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

using Repeat = FailCall::Repeat;
using testing::HasSubstr;

constexpr int kShards = 2;

class ShardFaultTest : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(20), scene_);
    writeTable(receiversOf(600), receivers_);
    options_.quality.max_solid_angle = 3;
    options_.quality.raster_resolution = 2;
    options_.threads = 2;
    options_.memory_bytes = std::uint64_t{256} << 20;
    const Status one =
        gatherCloud(scene_, receivers_, directory_.file("one.ply"), options_, quiet_).status();
    ASSERT_TRUE(one.ok()) << one.message();
    expected_ = readBytes(directory_.file("one.ply"));
  }

  Status gather(int shard) {
    return gatherShards(scene_, receivers_, result_, options_, {shard, shard, kShards}, quiet_)
        .status();
  }
  Status merge() {
    MergeOptions options;
    options.memory_bytes = std::uint64_t{256} << 20;
    options.threads = 2;
    options.removes_shards = true;
    return mergeShards(scene_, receivers_, result_, options, quiet_).status();
  }
  Status prepare() {
    for (int shard = 1; shard <= kShards; ++shard) SURFEIT_RETURN_IF_ERROR(gather(shard));
    return {};
  }

  // Each of the calls of a step fails in turn; whatever became of it, all steps are made after
  // that.
  void sweep(const std::function<Status()>& before, const std::function<Status()>& step) {
    CountCalls all;
    ASSERT_TRUE(before().ok());
    {
      const Faults faults({&all});
      ASSERT_TRUE(step().ok());
    }
    finish();
    ASSERT_GT(all.count(), 20);
    int failed = 0;
    for (const auto& [error, repeat] :
         {std::pair{EIO, Repeat::kOnce}, {ENOSPC, Repeat::kForEver}, {EMFILE, Repeat::kOnce}}) {
      for (int number = 1; number <= all.count(); ++number) {
        SCOPED_TRACE(testing::Message() << "call " << number << ", " << std::strerror(error));
        ASSERT_TRUE(before().ok());
        FailCall fail(number, error, repeat);
        const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
        {
          const Faults faults({&fail});
          const Status status = step();
          failed += status.ok() ? 0 : 1;
          if (!status.ok()) {
            // To a merge what it cannot open is missing, and why
            EXPECT_TRUE(status.code() == StatusCode::kIoError ||
                        status.message().find("are missing (") != std::string::npos)
                << status.message();
            EXPECT_THAT(status.message(), HasSubstr("/surfeit_gather_"));
          }
        }
        EXPECT_EQ(entryCount("/proc/self/fd"), descriptors);
        finish();
        if (HasFailure()) return;
      }
    }
    EXPECT_GT(failed, all.count());
  }

  // All that is left to do, on a disk that works; then nothing is left but the result.
  void finish() {
    const Status gathered = prepare();
    ASSERT_TRUE(gathered.ok()) << gathered.message();
    const Status merged = merge();
    ASSERT_TRUE(merged.ok()) << merged.message();
    EXPECT_TRUE(readBytes(result_) == expected_);
    EXPECT_TRUE(directory_.holdsOnly({"one.ply", "receivers.ply", "result.ply", "scene.sft"}));
    std::filesystem::remove(result_);
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  GatherOptions options_;
  Progress quiet_;
  std::string expected_;
};

TEST_F(ShardFaultTest, EveryCallOfTheFirstOneMayFail) {
  sweep([] { return Status(); }, [this] { return gather(1); });
}

TEST_F(ShardFaultTest, EveryCallOfOneThatGoesOnMayFail) {
  sweep([this] { return gather(1); }, [this] { return gather(2); });
}

TEST_F(ShardFaultTest, EveryCallOfTheMergeMayFail) {
  sweep([this] { return prepare(); }, [this] { return merge(); });
}

}  // namespace
}  // namespace surfeit
