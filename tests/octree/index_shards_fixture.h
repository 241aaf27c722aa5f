// Indexes in shards, beside those of one machine.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "index/shards/index_shard_file.h"
#include "octree/test_scenes.h"
#include "surfeit/index_shards.h"

namespace surfeit {

inline constexpr IndexPass kPasses[] = {IndexPass::kCount, IndexPass::kDistribute,
                                        IndexPass::kBuild};
inline constexpr IndexPass kPassesWithNeighbours[] = {IndexPass::kCount, IndexPass::kDistribute,
                                                      IndexPass::kBuild, IndexPass::kPlaces,
                                                      IndexPass::kSizes};

// Surfels on a few spheres of several sizes, so that some parts of the curve are dense, in any
// order.
inline std::vector<Surfel> unevenCloud(std::size_t count) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 4; ++i) {
    const float size = i < 2 ? 1.f : 0.1f * float(i);
    for (const Surfel& surfel : moved(sphereCloud(count / 4), size, {2.1f * float(i), 0.3f, 0})) {
      cloud.push_back(surfel);
    }
  }
  std::shuffle(cloud.begin(), cloud.end(), std::mt19937(5));
  return cloud;
}

class IndexShards : public SceneTest {
 protected:
  void SetUp() override {
    SceneTest::SetUp();
    out_ = path("out.sft");
    options_.threads = 2;
    options_.memory_bytes = 256 << 20;
  }

  Status pass(IndexPass pass, int shard, int count) {
    const Result<IndexShardStats> stats =
        indexShards(inputs_, out_, options_, pass, {shard, shard, count}, progress_);
    if (stats.ok()) finished_ += stats->finished_shards;
    return stats.status();
  }
  Status merge(int count, bool removes = false) {
    return mergeIndexShards(inputs_, out_, options_, count, removes, progress_).status();
  }
  // All passes. Shards come in an order that changes with the pass, with one and two threads.
  void indexAll(int count) {
    for (const IndexPass which : passes_) {
      // Shards that had to wait for others come again
      int left = count;
      for (int i = 0; i < 2 * count && left > 0; ++i) {
        options_.threads = 1 + i % 2;
        const int next = i % count;
        const int shard = 1 + (which == IndexPass::kDistribute ? count - 1 - next : next);
        const Status status = pass(which, shard, count);
        if (status.ok()) --left;
        ASSERT_TRUE(status.ok() || status.code() == StatusCode::kIncomplete) << status.message();
      }
      ASSERT_LE(left, 0);
    }
    const Status merged = merge(count);
    ASSERT_TRUE(merged.ok()) << merged.message();
  }
  // Against one machine; `ranges`: so many shards at least have something to build.
  void expectSameBytes(int count, int ranges = 1) {
    SCOPED_TRACE(count);
    indexFiles(inputs_, path("one.sft"), options_);
    indexAll(count);
    if (HasFatalFailure()) return;
    EXPECT_TRUE(bytesOf(out_) == bytesOf(path("one.sft")));
    EXPECT_GE(builtRanges(count), ranges);
    ASSERT_TRUE(merge(count, /* removes= */ true).ok());
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      EXPECT_THAT(entry.path().filename().string(), testing::Not(testing::HasSubstr("-of-")));
      EXPECT_THAT(entry.path().filename().string(), testing::Not(testing::HasSubstr(".places")));
    }
  }
  int builtRanges(int count) {
    int ranges = 0;
    for (int shard = 1; shard <= count; ++shard) {
      const auto reader =
          IndexShardReader::open(indexShardPath(out_, IndexPass::kBuild, shard, count));
      EXPECT_TRUE(reader.ok());
      if (reader.ok() && reader->payloadBytes() > 0) ++ranges;
    }
    return ranges;
  }
  void writeInput(const std::string& name, std::span<const Surfel> cloud,
                  const CloudChannels& channels = kAllChannels) {
    writeCloud(path(name), cloud, channels);
    inputs_.push_back(path(name));
  }

  std::vector<std::string> inputs_;
  std::string out_;
  IndexOptions options_;
  std::span<const IndexPass> passes_ = kPasses;
  int finished_ = 0;
};

}  // namespace surfeit
