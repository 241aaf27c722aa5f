#include "tune/sample_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace surfeit {
namespace {

// LocalReceiver r of `count` looks up the pages around its place: neighbours share nearly all.
constexpr std::uint32_t kPages = 2000, kAround = 10;
constexpr std::uint64_t kReceivers = 40000;

std::uint64_t lookUpAround(ReuseDistances& distances, std::uint64_t receiver) {
  const auto middle = std::uint32_t(receiver * (kPages - 2 * kAround) / kReceivers) + kAround;
  for (std::uint32_t page = middle - kAround; page < middle + kAround; ++page) {
    distances.touch(page);
  }
  return 2 * kAround;
}

TEST(SampleCurve, ASaturatingCountIsExtrapolatedAlongItsCurve) {
  const auto grown = [](double share) { return 5000 * share / (0.03 + share); };
  EXPECT_NEAR(extrapolateToAll(grown(0.1), grown(0.05), 0.1), grown(1), 1e-6);
  EXPECT_EQ(extrapolateToAll(700, 700, 0.1), 700);  // has stopped growing
  EXPECT_EQ(extrapolateToAll(700, 350, 1), 700);    // is all
  EXPECT_EQ(extrapolateToAll(0, 0, 0.1), 0);
  // In proportion, without any sign of an end
  EXPECT_NEAR(extrapolateToAll(700, 350, 0.1), 7000, 1e-6);
}

TEST(SampleCurve, ASweepIsForeseenFromATwentieth) {
  ReuseDistances all(kPages, kPages);
  std::uint64_t requests = 0;
  for (std::uint64_t i = 0; i < kReceivers; ++i) requests += lookUpAround(all, i);
  const MissRatioCurve expected = all.curve(requests);

  constexpr std::uint64_t kStride = 40;
  ReuseDistances every(kPages, kPages), second(kPages, kPages);
  std::uint64_t every_requests = 0, second_requests = 0;
  for (std::uint64_t i = 0; i < kReceivers; i += kStride) {
    every_requests += lookUpAround(every, i);
    if (i / kStride % 2 == 0) second_requests += lookUpAround(second, i);
  }
  StretchMisses stretches;
  for (std::uint64_t begin = 0; begin < kReceivers; begin += 4000) {
    ReuseDistances stretch(kPages, kPages);
    std::uint64_t stretch_requests = 0;
    for (std::uint64_t i = 0; i < 100; ++i) stretch_requests += lookUpAround(stretch, begin + i);
    stretches.begin(stretch, stretch_requests);
    for (std::uint64_t i = 100; i < 200; ++i) stretch_requests += lookUpAround(stretch, begin + i);
    stretches.end(stretch, stretch_requests);
  }
  const MissRatioCurve curve = wholeCurve(
      stretches, {every.curve(every_requests), second.curve(second_requests), 1.0 / kStride},
      kPages, 1);
  EXPECT_NEAR(curve.lookups(), expected.lookups(), 1);
  EXPECT_NEAR(curve.unavoidableMisses(), expected.unavoidableMisses(), 0.02 * kPages);
  for (const std::uint64_t frames : {1, 5, 15, 20, 30, 100, 1000, 2000}) {
    EXPECT_NEAR(curve.hitRate(frames), expected.hitRate(frames), 0.01) << frames;
  }
}

TEST(SampleCurve, LargerCachesNeverMissMoreAndNoPageIsReadFirstTwice) {
  // A sample that sees new pages all the time
  ReuseDistances every(100, 100), second(100, 100), stretch(100, 100);
  for (std::uint32_t page = 0; page < 60; ++page) {
    every.touch(page);
    if (page % 2 == 0) second.touch(page);
    stretch.touch(page);
  }
  StretchMisses stretches;
  stretches.begin(ReuseDistances(100, 100), 0);
  stretches.end(stretch, 60);
  const MissRatioCurve curve =
      wholeCurve(stretches, {every.curve(60), second.curve(30), 0.01}, 100, 1);
  EXPECT_EQ(curve.unavoidableMisses(), 100);
  for (std::uint64_t frames = 1; frames < 120; ++frames) {
    EXPECT_LE(curve.misses(frames), curve.misses(frames - 1));
  }
}

}  // namespace
}  // namespace surfeit
