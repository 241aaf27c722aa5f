// How two caches share one memory: by what each would save with more of it.
#pragma once

#include <cstddef>

#include "cache/miss_ratio_curve.h"

namespace surfeit {

// A cache that wants frames.
struct CacheDemand {
  MissRatioCurve curve;     // of recent look-ups
  double load_seconds = 0;  // what a miss costs
  std::size_t frame_bytes = 1;
  std::size_t least_frames = 1, most_frames = 1;
};

// Predicted seconds of loading with so many frames.
double loadSeconds(const CacheDemand& demand, std::size_t frames);

// The share of the first of two caches: the number of its frames, of total_bytes for both, with the
// least predicted loading; of equal ones the nearest to current_frames. Looks at kSplits divisions
// and the present one. The limits of both are kept, those of the first going before.
inline constexpr std::size_t kSplits = 64;
std::size_t bestFrames(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                       std::size_t current_frames);

}  // namespace surfeit
