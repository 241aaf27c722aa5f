#include "engine/cache_split.h"

#include <algorithm>

namespace surfeit {
namespace {

// Frames of `demand` that fit beside others.
std::size_t framesBeside(const CacheDemand& demand, std::size_t total_bytes, std::size_t others) {
  return (total_bytes - std::min(total_bytes, others)) / demand.frame_bytes;
}

}  // namespace

CacheSplit splitAt(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                   std::size_t first_frames) {
  const std::size_t second_frames = std::min(
      framesBeside(second, total_bytes, first_frames * first.frame_bytes), second.most_frames);
  return {first_frames, second_frames,
          first.curve.misses(first_frames) * first.load_seconds +
              second.curve.misses(second_frames) * second.load_seconds};
}

CacheSplit bestSplit(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                     std::size_t current_first_frames) {
  const std::size_t most =
      std::min(framesBeside(first, total_bytes, second.least_frames * second.frame_bytes),
               first.most_frames);
  const std::size_t least =
      std::min(std::max(first.least_frames,
                        framesBeside(first, total_bytes, second.most_frames * second.frame_bytes)),
               most);
  const std::size_t current = std::clamp(current_first_frames, least, most);
  const auto distance = [current](const CacheSplit& split) {
    return std::max(split.first_frames, current) - std::min(split.first_frames, current);
  };
  CacheSplit best = splitAt(first, second, total_bytes, current);
  for (std::size_t i = 0; i <= kSplits; ++i) {
    const CacheSplit split =
        splitAt(first, second, total_bytes, least + (most - least) * i / kSplits);
    if (split.load_seconds < best.load_seconds ||
        (split.load_seconds == best.load_seconds && distance(split) < distance(best))) {
      best = split;
    }
  }
  return best;
}

}  // namespace surfeit
