// Scenes by chance whose clouds bring positions and normals alone, beside the same scenes with
// sizes: surfaces of any density beside, before and through each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "random/indexed_scene.h"
#include "random/random_scene.h"
#include "random/result_differences.h"

namespace surfeit {
namespace {

// RMS of the occlusion over the receivers of a scene. Goals: .01, .03, none. (Before places told by
// their normals what is sparse: .027, .124, 9.) What is left are sheets closer than their surfels
// are wide, and slats a surfel wide, whose width positions do not tell.
constexpr double kMostOfHalf = .012, kMostOfNineTenths = .085;
constexpr std::ptrdiff_t kMostAboveTenth = 5;

TEST(BareScenes, ComeCloseToTheSameWithSizes) {
  std::vector<double> rms;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const RandomScene sized = makeRandomScene(seed, {.density = 2, .without_noise = true});
    const RandomScene bare = sized.withoutSizes(false);
    if (bare.surfels.empty()) continue;
    const auto right = IndexedScene::make(sized.onlySurfaces().surfels);
    const auto found = IndexedScene::make(bare.surfels);
    ASSERT_TRUE(right.ok() && found.ok()) << seed;
    const std::vector<LocalReceiver> receivers = sized.plainReceivers();
    const GatherRules rules(GatherMode::kOcclusion, {});
    const auto expected = (*right)->gatherTogether(receivers, rules);
    const auto results = (*found)->gatherTogether(receivers, rules);
    ASSERT_TRUE(expected.ok() && results.ok()) << seed;
    rms.push_back(differencesOf(*results, *expected).rms);
    if (rms.back() > .1) std::printf("seed %d: %.3f\n", int(seed), rms.back());
  }
  std::sort(rms.begin(), rms.end());
  const double nine_tenths = rms[rms.size() * 9 / 10];
  std::printf("%zu scenes: median %.4f, 90 %% %.4f\n", rms.size(), rms[rms.size() / 2],
              nine_tenths);
  EXPECT_LE(rms[rms.size() / 2], kMostOfHalf);
  EXPECT_LE(nine_tenths, kMostOfNineTenths);
  EXPECT_LE(rms.end() - std::upper_bound(rms.begin(), rms.end(), .1), kMostAboveTenth);
}

}  // namespace
}  // namespace surfeit
