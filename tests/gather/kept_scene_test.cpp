// Gathers in a scene that is kept have the bytes of gathers that open it, and read no page that is
// there.
#include "surfeit/kept_scene.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "gather/test_clouds.h"
#include "octree/read/scene_file.h"

namespace surfeit {
namespace {

std::uint64_t pagesRead(const GatherStats& stats) {
  return stats.node_cache.misses + stats.node_cache.prefetches + stats.surfel_cache.misses +
         stats.surfel_cache.prefetches;
}

class KeptScenes : public testing::Test {
 protected:
  void SetUp() override {
    makeScene(floorAndSphere(250), scene_);
    options_.quality.max_solid_angle = 0.05f;
    options_.quality.raster_resolution = 4;
    options_.threads = 2;
    options_.memory_bytes = std::uint64_t{1} << 30;
  }

  // Receivers number `frame`, in a file that stays.
  std::string receivers(int count, unsigned frame) {
    const std::string path = directory_.file("r" + std::to_string(frame) + ".ply");
    writeTable(receiversOf(count, frame), path);
    return path;
  }

  // Gathers in the kept scene, and compares with a gather that opens the scene.
  GatherStats gatherBoth(const std::string& receivers) {
    const auto alone =
        gatherCloud(scene_, receivers, directory_.file("alone.ply"), options_, progress_);
    const auto kept =
        gatherCloud(scene_, receivers, directory_.file("kept.ply"), options_, progress_, kept_);
    EXPECT_TRUE(alone.ok()) << alone.status().message();
    EXPECT_TRUE(kept.ok()) << kept.status().message();
    if (!alone.ok() || !kept.ok()) return {};
    EXPECT_TRUE(readBytes(directory_.file("alone.ply")) == readBytes(directory_.file("kept.ply")));
    EXPECT_EQ(kept->receivers, alone->receivers);
    return *kept;
  }

  // The least budget of these receivers, and so many bytes more.
  void setBudget(const std::string& receivers, std::uint64_t more) {
    const Result<SceneFile> scene = SceneFile::open(scene_);
    const Result<GatherInput> input = GatherInput::open(receivers);
    ASSERT_TRUE(scene.ok() && input.ok());
    options_.memory_bytes =
        leastGatherMemory(*scene, gatherWork(input->receivers(), options_)) + more;
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  GatherOptions options_;
  Progress progress_;
  KeptScene kept_;
};

TEST_F(KeptScenes, TheSecondGatherReadsNoPageOfTheFirst) {
  const std::string path = receivers(2000, 1);
  EXPECT_FALSE(kept_.isOpen());
  EXPECT_GT(pagesRead(gatherBoth(path)), 0u);
  EXPECT_TRUE(kept_.isOpen());
  const GatherStats second = gatherBoth(path);
  EXPECT_EQ(pagesRead(second), 0u);
  EXPECT_EQ(second.node_cache.bytes_read + second.surfel_cache.bytes_read, 0u);
  kept_.close();
  EXPECT_FALSE(kept_.isOpen());
  EXPECT_GT(pagesRead(gatherBoth(path)), 0u);
}

// Numbers of receivers change the plan, and too little memory empties the caches.
TEST_F(KeptScenes, ResultsAreThoseOfCallsOfTheirOwnInAnyBudget) {
  const std::string first = receivers(1500, 1), most = receivers(4000, 4);
  for (const std::uint64_t more : {0, 2 << 20, 14 << 20, 60 << 20}) {
    setBudget(most, more);
    kept_.close();
    std::uint64_t frame = 0;
    for (const int count : {1500, 1500, 100, 1, 4000}) {
      const std::string path = frame < 2 ? first : receivers(count, unsigned(frame));
      const GatherStats stats = gatherBoth(path);
      // With room for all of them no page is read twice
      if (frame == 0) {
        EXPECT_GT(pagesRead(stats), 0u);
      }
      if (frame == 1 && more == 60 << 20) {
        EXPECT_EQ(pagesRead(stats), 0u);
      }
      EXPECT_LE(stats.node_cache.budget_bytes + stats.surfel_cache.budget_bytes,
                options_.memory_bytes);
      ++frame;
    }
  }
}

TEST_F(KeptScenes, ASceneThatHasChangedIsOpenedAgain) {
  const std::string path = receivers(500, 1);
  gatherBoth(path);
  const std::string before = readBytes(directory_.file("kept.ply"));
  makeScene(floorAndSphere(60), scene_);
  EXPECT_GT(pagesRead(gatherBoth(path)), 0u);
  EXPECT_FALSE(readBytes(directory_.file("kept.ply")) == before);
  std::filesystem::remove(scene_);
  const auto gone =
      gatherCloud(scene_, path, directory_.file("kept.ply"), options_, progress_, kept_);
  EXPECT_EQ(gone.status().code(), StatusCode::kIoError);
}

TEST_F(KeptScenes, OtherOptionsHaveTheirOwnResults) {
  const std::string path = receivers(500, 1);
  gatherBoth(path);
  options_.mode = GatherMode::kBleeding;
  EXPECT_LT(pagesRead(gatherBoth(path)), 10u);  // other receivers may ask for more
  options_.direct_io = true;
  EXPECT_GT(pagesRead(gatherBoth(path)), 0u);
  options_.quality.max_solid_angle = 0.3f;
  options_.threads = 1;
  gatherBoth(path);
  options_.cache_split = 0.8;
  gatherBoth(path);
}

// A gather that fails leaves nothing of a scene in the way of the next.
TEST_F(KeptScenes, AFailureIsOfOneGather) {
  const std::string path = receivers(300, 1);
  gatherBoth(path);
  const auto gone = gatherCloud(scene_, directory_.file("none.ply"), directory_.file("kept.ply"),
                                options_, progress_, kept_);
  EXPECT_EQ(gone.status().code(), StatusCode::kIoError);
  const auto self = gatherCloud(scene_, path, scene_, options_, progress_, kept_);
  EXPECT_EQ(self.status().code(), StatusCode::kInvalidArgument);
  gatherBoth(path);
  KeptScene other = std::move(kept_);
  EXPECT_TRUE(other.isOpen());
  kept_ = std::move(other);
  EXPECT_EQ(pagesRead(gatherBoth(path)), 0u);
}

}  // namespace
}  // namespace surfeit
