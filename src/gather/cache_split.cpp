#include "gather/cache_split.h"

#include <algorithm>

namespace surfeit {
namespace {

std::size_t framesOfSecond(const CacheDemand& first, const CacheDemand& second,
                           std::size_t total_bytes, std::size_t first_frames) {
  const std::size_t left = total_bytes - std::min(total_bytes, first_frames * first.frame_bytes);
  return std::min(left / second.frame_bytes, second.most_frames);
}

}  // namespace

double loadSeconds(const CacheDemand& demand, std::size_t frames) {
  return demand.curve.misses(frames) * demand.load_seconds;
}

std::size_t bestFrames(const CacheDemand& first, const CacheDemand& second, std::size_t total_bytes,
                       std::size_t current_frames) {
  const std::size_t second_least = second.least_frames * second.frame_bytes;
  const std::size_t most = std::min(
      (total_bytes - std::min(total_bytes, second_least)) / first.frame_bytes, first.most_frames);
  const std::size_t least = std::min(
      std::max(first.least_frames,
               (total_bytes - std::min(total_bytes, second.most_frames * second.frame_bytes)) /
                   first.frame_bytes),
      most);
  const auto cost = [&](std::size_t frames) {
    return loadSeconds(first, frames) +
           loadSeconds(second, framesOfSecond(first, second, total_bytes, frames));
  };
  const auto distance = [&](std::size_t frames) {
    return std::max(frames, current_frames) - std::min(frames, current_frames);
  };
  std::size_t best = std::clamp(current_frames, least, most);
  double best_cost = cost(best);
  for (std::size_t i = 0; i <= kSplits; ++i) {
    const std::size_t frames = least + (most - least) * i / kSplits;
    const double frames_cost = cost(frames);
    if (frames_cost < best_cost ||
        (frames_cost == best_cost && distance(frames) < distance(best))) {
      best = frames;
      best_cost = frames_cost;
    }
  }
  return best;
}

}  // namespace surfeit
