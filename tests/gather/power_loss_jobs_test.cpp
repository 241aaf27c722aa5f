// A power loss during a job leaves the old result or the new one, and what the next run needs to go
// on to the same bytes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <set>
#include <string>

#include "gather/test_clouds.h"
#include "io/power_loss.h"
#include "surfeit/bake.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

using Disk = PowerLoss::Disk;

class PowerLossJobs : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(30), scene_);
    writeTable(receiversOf(2000), receivers_);
    options_.quality.max_solid_angle = 0.3f;
    options_.quality.raster_resolution = 4;
    options_.memory_bytes = 256 << 20;
    options_.threads = 2;
    makeDirectory("disk");
  }

  std::string makeDirectory(const std::string& name) {
    std::filesystem::remove_all(directory_.file(name));
    std::filesystem::create_directory(directory_.file(name));
    return directory_.file(name);
  }
  std::string expected() {
    const auto one =
        gatherCloud(scene_, receivers_, directory_.file("one.ply"), options_, progress_);
    EXPECT_TRUE(one.ok()) << one.status().message();
    return readBytes(directory_.file("one.ply"));
  }

  // Runs a job that replaces disk/NAME.
  void replace(const std::string& name, const std::function<Status()>& job) {
    SCOPED_TRACE(name);
    const std::string path = directory_.file("disk/" + name);
    PowerLoss::restore({{name, "old"}}, directory_.file("disk"));
    std::set<std::string> left;
    const auto look = [&](const Disk& disk) {
      left.insert(disk.contains(name) ? disk.at(name) : "");
    };
    PowerLoss disk(directory_.file("disk"), 1, look);
    {
      const Faults faults({&disk});
      const Status status = job();
      ASSERT_TRUE(status.ok()) << status.message();
    }
    const std::string bytes = readBytes(path);
    ASSERT_GT(bytes.size(), 1000u);
    EXPECT_EQ(left, (std::set<std::string>{"old", bytes}));
    disk.loseNow([&](const Disk& files) { EXPECT_TRUE(files == (Disk{{name, bytes}})); });
    fmt::print("{}: {} losses\n", name, disk.losses());
  }

  // What any loss during a job leaves, each kind once.
  std::set<Disk> lossesOf(const std::function<Status()>& job, unsigned seed) {
    std::set<Disk> left;
    PowerLoss disk(directory_.file("disk"), seed, [&](const Disk& files) { left.insert(files); });
    const Faults faults({&disk});
    const Status status = job();
    EXPECT_TRUE(status.ok()) << status.message();
    return left;
  }

  Status gatherShard(const std::string& result, int shard) {
    return gatherShards(scene_, receivers_, result, options_, {shard, shard, 3}, progress_)
        .status();
  }
  Status merge(const std::string& result) {
    MergeOptions options;
    options.memory_bytes = 256 << 20;
    options.threads = 2;
    options.removes_shards = true;
    return mergeShards(scene_, receivers_, result, options, progress_).status();
  }
  Status resume(const std::string& result) {
    for (int shard = 1; shard <= 3; ++shard) SURFEIT_RETURN_IF_ERROR(gatherShard(result, shard));
    return merge(result);
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft"), receivers_ = directory_.file("r.ply");
  GatherOptions options_;
  Progress progress_;
};

TEST_F(PowerLossJobs, LeaveTheOldResultOrTheNewOne) {
  const std::string cloud = directory_.file("cloud.ply");
  writeTable(floorAndSphere(30), cloud);
  replace("scene.sft", [&] {
    return indexClouds({cloud}, directory_.file("disk/scene.sft"), {}, progress_).status();
  });
  makeDirectory("disk");
  replace("result.ply", [&] {
    return gatherCloud(scene_, receivers_, directory_.file("disk/result.ply"), options_, progress_)
        .status();
  });
  makeDirectory("disk");
  replace("converted.las", [&] {
    const std::string path = directory_.file("disk/converted.las");
    return convertClouds({cloud}, path, {}, progress_).status();
  });
}

// Shards, their plan, and the merge that removes them.
TEST_F(PowerLossJobs, ResumedGathersHaveTheSameBytes) {
  const std::string whole = expected();
  std::set<Disk> left;
  for (unsigned seed = 0; seed < 3; ++seed) {
    makeDirectory("disk");
    left.merge(lossesOf([&] { return resume(directory_.file("disk/out.ply")); }, seed));
    EXPECT_TRUE(readBytes(directory_.file("disk/out.ply")) == whole);
  }
  fmt::print("{} different disks\n", left.size());
  ASSERT_GT(left.size(), 15u);
  for (const Disk& disk : left) {
    if (disk.contains("out.ply")) {
      EXPECT_TRUE(disk.at("out.ply") == whole);  // shards may be gone
      continue;
    }
    const std::string directory = makeDirectory("again");
    PowerLoss::restore(disk, directory);
    const Status status = resume(directory + "/out.ply");
    ASSERT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(readBytes(directory + "/out.ply") == whole);
  }
}

// No shard goes before what was merged of it is safe.
TEST_F(PowerLossJobs, AMergeKeepsItsShardsUntilTheResultIsSafe) {
  for (int shard = 1; shard <= 3; ++shard) {
    ASSERT_TRUE(gatherShard(directory_.file("disk/out.ply"), shard).ok());
  }
  const std::set<Disk> left = lossesOf([&] { return merge(directory_.file("disk/out.ply")); }, 7);
  std::size_t without_result = 0;
  for (const Disk& disk : left) {
    if (disk.contains("out.ply")) continue;
    ++without_result;
    EXPECT_GE(disk.size(), 4u) << "three shards and their plan";
  }
  EXPECT_GT(without_result, 0u);
}

}  // namespace
}  // namespace surfeit
