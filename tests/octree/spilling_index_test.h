// Runs of the indexer that go by way of a temporary file, though their clouds are small.
#pragma once

#include <gmock/gmock.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "io/fault_injector.h"
#include "octree/test_scenes.h"

namespace surfeit {

// The file that a descriptor is open on; where it has no name, something in its directory.
inline std::string fileOf(int descriptor) {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(descriptor), error);
}

// Reads of the files whose path begins so.
inline CallFilter readsBelow(const std::string& path) {
  return [path](const CallInfo& info) {
    return info.call == Call::kPread && fileOf(info.descriptor).starts_with(path);
  };
}

// More surfels than this make several buckets.
inline constexpr std::size_t kOneBucket = 33000;

// A cloud in one directory, its scene in a second, temporary files in a third. The budget is the
// least that eight threads can work with, which leaves no room for blocks in memory.
class SpillingIndexTest : public SceneTest {
 protected:
  void SetUp() override {
    SceneTest::SetUp();
    for (const char* name : {"in", "out", "temp"}) {
      std::filesystem::create_directory(directory_ / name);
    }
    options_.threads = 8;
    options_.temporary_directory = path("temp");
  }

  Result<IndexStats> tryIndex() {
    return indexClouds({path("in/cloud.ply")}, path("out/scene.sft"), options_, progress_);
  }

  // Indexes the cloud, with success; the scene is what others are compared with.
  void makeScene(std::span<const Surfel> cloud, const CloudChannels& channels = kAllChannels) {
    writeCloud(path("in/cloud.ply"), cloud, channels);
    options_.memory_bytes = 64 << 20;
    Result<IndexStats> stats = tryIndex();
    while (stats.status().code() == StatusCode::kBudgetTooSmall) {
      options_.memory_bytes += 1 << 20;
      stats = tryIndex();
    }
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    EXPECT_GT(stats->temporary_bytes, 0u);
    EXPECT_EQ(stats->surfels, cloud.size());
    EXPECT_THAT(findingsOf(path("out/scene.sft")), testing::IsEmpty());
    expected_ = contents("out/scene.sft");
  }

  std::vector<std::string> filesIn(const char* name) const {
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(directory_ / name)) {
      files.push_back(entry.path().filename());
    }
    return files;
  }

  IndexOptions options_;
  std::string expected_;
};

}  // namespace surfeit
