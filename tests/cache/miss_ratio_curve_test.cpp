#include "cache/miss_ratio_curve.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace surfeit {
namespace {

// 1000 look-ups: 100 first touches, 500 reuses of the page just looked up, 300 beyond 3 others, 100
// beyond 9.
MissRatioCurve testCurve() {
  return MissRatioCurve(1, std::vector<double>{500, 0, 0, 300, 0, 0, 0, 0, 0, 100, 0, 0}, 100,
                        1000);
}

TEST(MissRatioCurve, ReusesAreHitsOnceTheirDistanceFits) {
  const MissRatioCurve curve = testCurve();
  EXPECT_EQ(curve.misses(0), 1000);
  EXPECT_EQ(curve.misses(1), 500);
  EXPECT_EQ(curve.misses(3), 500);
  EXPECT_EQ(curve.misses(4), 200);
  EXPECT_EQ(curve.misses(9), 200);
  EXPECT_EQ(curve.misses(10), 100);
  EXPECT_EQ(curve.misses(1'000'000), 100);
  EXPECT_EQ(curve.unavoidableMisses(), 100);
  EXPECT_DOUBLE_EQ(curve.hitRate(4), 0.8);
}

TEST(MissRatioCurve, FindsTheSmallestCacheThatDoes) {
  const MissRatioCurve curve = testCurve();
  EXPECT_EQ(curve.framesForMisses(1000), 0u);
  EXPECT_EQ(curve.framesForMisses(999), 1u);
  EXPECT_EQ(curve.framesForMisses(499), 4u);
  EXPECT_EQ(curve.framesForMisses(100), 10u);
  EXPECT_EQ(curve.framesForMisses(99), std::nullopt);
  EXPECT_EQ(curve.framesForMisses(std::numeric_limits<double>::quiet_NaN()), std::nullopt);
  EXPECT_EQ(curve.saturation(), 10u);
}

TEST(MissRatioCurve, SampledReusesSpreadOverThePagesTheyStandFor) {
  const MissRatioCurve curve(10, std::vector<double>{5, 2}, 1, 100);
  EXPECT_EQ(curve.misses(0), 100);
  EXPECT_EQ(curve.misses(1), 75);  // 80 sampled: the other 20 look-ups are hits
  EXPECT_EQ(curve.misses(5), 55);
  EXPECT_EQ(curve.misses(10), 30);
  EXPECT_EQ(curve.misses(15), 20);
  EXPECT_EQ(curve.misses(20), 10);
  EXPECT_EQ(curve.misses(21), 10);
  EXPECT_EQ(curve.saturation(), 20u);
}

TEST(MissRatioCurve, MissesAreNoMoreThanLookups) {
  const MissRatioCurve curve(10, std::vector<double>{50, 20}, 1, 100);  // 710 sampled
  EXPECT_EQ(curve.misses(1), 100);
  EXPECT_EQ(curve.misses(12), 100);
  EXPECT_EQ(curve.misses(20), 10);
  EXPECT_EQ(MissRatioCurve(10, {}, 20, 100).unavoidableMisses(), 100);
}

TEST(MissRatioCurve, KneeIsWhereTheTailOfMissesHardlyMatters) {
  std::vector<double> reuses(1000, 0.0);
  reuses[20] = 90'000;  // the working set
  reuses[900] = 40;     // a rare look back, less than 0.05 % of all look-ups
  EXPECT_EQ(MissRatioCurve(1, reuses, 1000, 100'000).knee(), 21u);
  reuses[900] = 400;  // no longer rare
  EXPECT_EQ(MissRatioCurve(1, reuses, 1000, 100'000).knee(), 901u);
  EXPECT_EQ(MissRatioCurve(1, reuses, 8000, 100'000).knee(), 21u);  // within 5 % of 8000
}

TEST(MissRatioCurve, WithoutLookupsThereIsNothingToMiss) {
  const MissRatioCurve curve;
  EXPECT_EQ(curve.lookups(), 0);
  EXPECT_EQ(curve.misses(0), 0);
  EXPECT_EQ(curve.misses(5), 0);
  EXPECT_EQ(curve.hitRate(0), 1);
  EXPECT_EQ(curve.saturation(), 0u);
  EXPECT_EQ(curve.knee(), 0u);
  EXPECT_EQ(curve.framesForMisses(0), 0u);
}

}  // namespace
}  // namespace surfeit
