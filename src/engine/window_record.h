// What the caches did over time, in windows that join in pairs when they become too many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cache/cache_counters.h"
#include "surfeit/statistics.h"

namespace surfeit {

// What a cache did since `then`, for those outside; without working set.
GatherCacheStats statsBetween(const CacheCounters& then, const CacheCounters& now);

// One thread at a time. Takes memoryBytes(), however long it lasts.
class WindowRecord {
 public:
  static constexpr std::size_t kMostWindows = 256;
  static constexpr std::size_t memoryBytes() {
    return sizeof(WindowRecord) + kMostWindows * (sizeof(Moment) + sizeof(GatherWindow));
  }

  // All counts so far, and how things are now.
  struct Moment {
    double seconds = 0;
    std::uint64_t receivers = 0;
    std::uint64_t run_receivers = 0, prefetch_receivers = 0;
    CacheCounters nodes, surfels;
    std::uint64_t node_working_set_bytes = 0, surfel_working_set_bytes = 0;
  };

  // The first window begins at `begin`; windows take this long, longer when they have joined.
  WindowRecord(const Moment& begin, double window_seconds);

  bool isDue(double seconds) const { return seconds - last().seconds >= window_seconds_; }
  // A window ends, and the next begins.
  void add(const Moment& end);
  std::vector<GatherWindow> windows() const;

 private:
  const Moment& last() const { return ends_.empty() ? begin_ : ends_.back(); }

  Moment begin_;
  double window_seconds_;
  std::vector<Moment> ends_;
};

}  // namespace surfeit
