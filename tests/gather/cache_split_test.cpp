#include "engine/cache_split.h"

#include <gtest/gtest.h>

#include <vector>

namespace surfeit {
namespace {

// A cache whose pages are looked up in a loop of `pages`: misses all unless it holds all.
CacheDemand loopOf(std::size_t pages, double load_seconds, std::size_t frame_bytes) {
  std::vector<double> reuses(pages, 0);
  reuses[pages - 1] = 1e6;
  CacheDemand demand;
  demand.curve = MissRatioCurve(1, reuses, double(pages), 1e6 + double(pages));
  demand.load_seconds = load_seconds;
  demand.frame_bytes = frame_bytes;
  demand.least_frames = 10;
  demand.most_frames = 1000;
  return demand;
}

TEST(CacheSplit, MemoryGoesWhereItSavesMost) {
  // Room for one of two loops; the dearer one gets it
  const CacheDemand cheap = loopOf(500, 1e-5, 1), dear = loopOf(500, 1e-3, 1);
  EXPECT_GE(bestSplit(dear, cheap, 700, 10).first_frames, 500u);
  EXPECT_LE(bestSplit(cheap, dear, 700, 690).first_frames, 200u);
}

TEST(CacheSplit, BothGetWhatTheyNeedWhenThereIsEnough) {
  const CacheDemand nodes = loopOf(100, 1e-5, 2), surfels = loopOf(400, 1e-5, 1);
  const std::size_t frames = bestSplit(nodes, surfels, 700, 10).first_frames;
  EXPECT_GE(frames, 100u);
  EXPECT_LE(700 - 2 * frames, 500u);
  EXPECT_GE(700 - 2 * frames, 400u);
}

TEST(CacheSplit, StaysWhereNothingIsBetter) {
  const CacheDemand small = loopOf(10, 1e-5, 1);
  for (const std::size_t current : {50, 300, 600}) {
    EXPECT_EQ(bestSplit(small, small, 700, current).first_frames, current);
  }
}

TEST(CacheSplit, LimitsOfBothAreKept) {
  const CacheDemand greedy = loopOf(900, 1, 1), modest = loopOf(900, 1e-9, 1);
  EXPECT_LE(bestSplit(greedy, modest, 700, 400).first_frames, 690u);
  EXPECT_GE(bestSplit(modest, greedy, 700, 400).first_frames, 10u);
  CacheDemand limited = greedy;
  limited.most_frames = 300;
  EXPECT_LE(bestSplit(limited, modest, 700, 400).first_frames, 300u);
}

TEST(CacheSplit, TheSecondGetsWhatIsLeftAndCanBeUsed) {
  const CacheDemand nodes = loopOf(500, 1e-3, 2), surfels = loopOf(500, 1e-5, 1);
  const CacheSplit split = splitAt(nodes, surfels, 700, 100);
  EXPECT_EQ(split.second_frames, 500u);
  EXPECT_NEAR(split.load_seconds, 1000.5 + 0.005, 1e-6);  // misses times what they cost
  EXPECT_EQ(splitAt(nodes, surfels, 5000, 100).second_frames, 1000u);
  EXPECT_EQ(splitAt(nodes, surfels, 100, 400).second_frames, 0u);
}

}  // namespace
}  // namespace surfeit
