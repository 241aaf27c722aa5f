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

struct CacheSplit {
  std::size_t first_frames = 0, second_frames = 0;
  double load_seconds = 0;  // predicted, of both
};

// The first cache with so many frames, the second with what that leaves of total_bytes, or all that
// it can use.
CacheSplit splitAt(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                   std::size_t first_frames);

// The split with the least predicted loading; of equal ones the nearest to current_first_frames.
// Looks at kSplits divisions and the present one. The limits of both are kept, those of the second
// going before.
inline constexpr std::size_t kSplits = 64;
CacheSplit bestSplit(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                     std::size_t current_first_frames);

}  // namespace surfeit
