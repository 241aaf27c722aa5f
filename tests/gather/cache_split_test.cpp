#include "gather/cache_split.h"

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
  EXPECT_GE(bestFrames(dear, cheap, 700, 10), 500u);
  EXPECT_LE(bestFrames(cheap, dear, 700, 690), 200u);
}

TEST(CacheSplit, BothGetWhatTheyNeedWhenThereIsEnough) {
  const CacheDemand nodes = loopOf(100, 1e-5, 2), surfels = loopOf(400, 1e-5, 1);
  const std::size_t frames = bestFrames(nodes, surfels, 700, 10);
  EXPECT_GE(frames, 100u);
  EXPECT_LE(700 - 2 * frames, 500u);
  EXPECT_GE(700 - 2 * frames, 400u);
}

TEST(CacheSplit, StaysWhereNothingIsBetter) {
  const CacheDemand small = loopOf(10, 1e-5, 1);
  for (const std::size_t current : {50, 300, 600}) {
    EXPECT_EQ(bestFrames(small, small, 700, current), current);
  }
}

TEST(CacheSplit, LimitsOfBothAreKept) {
  const CacheDemand greedy = loopOf(900, 1, 1), modest = loopOf(900, 1e-9, 1);
  EXPECT_LE(bestFrames(greedy, modest, 700, 400), 690u);
  EXPECT_GE(bestFrames(modest, greedy, 700, 400), 10u);
  CacheDemand limited = greedy;
  limited.most_frames = 300;
  EXPECT_LE(bestFrames(limited, modest, 700, 400), 300u);
}

TEST(CacheSplit, LoadSecondsAreMissesTimesCost) {
  const CacheDemand demand = loopOf(500, 1e-3, 1);
  EXPECT_NEAR(loadSeconds(demand, 100), 1000.5, 1e-6);
  EXPECT_NEAR(loadSeconds(demand, 500), 0.5, 1e-6);
}

}  // namespace
}  // namespace surfeit
