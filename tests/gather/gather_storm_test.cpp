// Gathers amid signals, interrupted calls and short transfers: the bytes are those of a quiet one.
#include <gtest/gtest.h>

#include <initializer_list>
#include <string>

#include "gather/test_clouds.h"
#include "io/fault_injector.h"
#include "io/signal_storm.h"
#include "surfeit/bake.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

class GatherStorm : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(60), scene_);
    writeTable(receiversOf(40'000), receivers_);
    options_.quality.max_solid_angle = 3;
    options_.quality.raster_resolution = 2;
    options_.threads = 3;
    options_.temporary_directory = directory_.file("");
    // The least memory, which the message names: receivers and results go by way of the disk
    options_.memory_bytes = 1;
    const std::string message = gather().message();
    const std::size_t end = message.find(" MiB is the least that works");
    ASSERT_NE(end, message.npos) << message;
    const double least = std::stod(message.substr(message.rfind(' ', end - 1) + 1));
    options_.memory_bytes = static_cast<std::uint64_t>(least * (1 << 20)) + 1;
    CountCalls calls;
    {
      const Faults faults({&calls});
      const Status status = gather();
      ASSERT_TRUE(status.ok()) << status.message();
    }
    ASSERT_GT(calls.count(), 100);
    expected_ = readBytes(result_);
  }

  Status gather() { return gatherCloud(scene_, receivers_, result_, options_, quiet_).status(); }
  Status gatherByShards() {
    for (int shard = 1; shard <= 3; ++shard) {
      SURFEIT_RETURN_IF_ERROR(
          gatherShards(scene_, receivers_, result_, options_, {shard, shard, 3}, quiet_).status());
    }
    MergeOptions merge;
    merge.memory_bytes = std::uint64_t{256} << 20;
    merge.removes_shards = true;
    return mergeShards(scene_, receivers_, result_, merge, quiet_).status();
  }

  void expectSameBytes(std::initializer_list<FaultInjector*> injectors) {
    for (const bool by_shards : {false, true}) {
      SCOPED_TRACE(by_shards ? "by shards" : "at once");
      std::filesystem::remove(result_);
      {
        const Faults faults(injectors);
        const Status status = by_shards ? gatherByShards() : gather();
        ASSERT_TRUE(status.ok()) << status.message();
      }
      EXPECT_TRUE(readBytes(result_) == expected_);
      EXPECT_TRUE(directory_.holdsOnly({"receivers.ply", "result.ply", "scene.sft"}));
    }
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  const std::string receivers_ = directory_.file("receivers.ply");
  const std::string result_ = directory_.file("result.ply");
  GatherOptions options_;
  Progress quiet_;
  std::string expected_;
};

TEST_F(GatherStorm, SignalsDoNotChangeTheResult) {
  const SignalStorm storm;
  expectSameBytes({});
  EXPECT_GT(storm.count(), 20);
}

TEST_F(GatherStorm, InterruptedCallsDoNotChangeTheResult) {
  InterruptStorm storm;
  expectSameBytes({&storm});
}

TEST_F(GatherStorm, ShortTransfersDoNotChangeTheResult) {
  for (const std::size_t limit : {std::size_t{0}, std::size_t{4095}}) {
    ShortTransfers shorten(limit);
    expectSameBytes({&shorten});
  }
}

}  // namespace
}  // namespace surfeit
