// What the gather may differ by on random scenes. Each limit is a little above what the present
// engine needs on the seeds of the normal run; the goal stands beside it.
#pragma once

namespace surfeit {

// Occlusion of a kind of gather against the exact one, over the scenes of a batch of 25: the RMS
// over a scene's receivers, the worst receiver, and how many scenes may exceed kUsualRms and
// kLargeRms. Light is the RMS of irradiance over the mean irradiance of the scene.
struct FidelityLimits {
  double rms, worst;
  int above_usual, above_large;
  double median_light;
};
inline constexpr double kUsualRms = .01, kLargeRms = .02;

// Goal of all: rms .02, worst .1, none above .02, none above .01 in three batches of four (99 % of
// scenes), median light .01; final: half of each. Counts are of 25 scenes, in proportion where a
// batch has fewer.
inline constexpr FidelityLimits kFrontLimits = {.012, .035, 1, 0, .008};
inline constexpr FidelityLimits kBothLimits = {.012, .035, 1, 0, .018};
inline constexpr FidelityLimits kBackLimits = {.006, .027, 0, 0, .15};
inline constexpr FidelityLimits kFinalLimits = {.002, .008, 0, 0, .0012};
inline constexpr FidelityLimits kGlossyLimits = {.0075, .045, 0, 0, .007};
inline constexpr FidelityLimits kConeLimits = {.0045, .02, 0, 0, .007};
inline constexpr FidelityLimits kFalloffLimits = {.006, .025, 0, 0, .015};
inline constexpr FidelityLimits kTranslucentLimits = {.0075, .025, 0, 0, .006};
inline constexpr FidelityLimits kSubsetLimits = {.0045, .025, 0, 0, .0145};

// One bounce, by default against exactly: RMS of irradiance over its mean. Goal: .02.
inline constexpr double kMostBounceLight = .0025;

// A receiver with others against alone. Of all receivers of a batch, so many in 10,000 may differ
// by more than kUsualStep; goal 1. None by more than kMostStep; goal .01.
inline constexpr double kUsualStep = .004, kMostStep = .007;
inline constexpr double kUnusualSteps = 80;
// Light, rms over the mean of a scene: of half of the scenes, and of nine tenths.
inline constexpr double kMedianLightStep = .002, kLargeLightStep = .06;

// The same scene moved, turned by quarters, and twice as large. Results of the exact gather differ
// by rounding, of the default by other cells of the octree as well: RMS over a scene. Goals: .002
// and .01 for what is moved or turned, nothing for the scale.
struct InvarianceLimits {
  double exact, fast;
};
// Nodes decide which two-sided surfels are of a sheet, and their hulls close gaps between surfels;
// another place has other nodes. (.0180 is of seed 29, a two-sided bowl with skins closer than the
// bias, some of which cells of the octree tell apart.)
inline constexpr InvarianceLimits kMovedLimits = {.02, .02}, kTurnedLimits = {.02, .02};
inline constexpr InvarianceLimits kScaledLimits = {0, 0};

}  // namespace surfeit
