// Watches the two caches, keeps a record of what they did, and moves memory to the one that saves
// more loading with it. docs/architecture.md, "The monitor", tells by which rules. No result
// depends on any of it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "engine/window_record.h"
#include "octree/read/octree_caches.h"
#include "surfeit/statistics.h"

namespace surfeit {

// Safe from any thread.
class CacheMonitor {
 public:
  using Moment = WindowRecord::Moment;
  struct Options {
    bool adapts_split = true;
    bool is_warm = false;  // what the caches did before is not of this monitor
    std::size_t least_node_frames = 1, least_surfel_frames = 1;
  };

  // The caches must outlive the monitor, and track pages unless it never advances.
  CacheMonitor(OctreeCaches& caches, const Options& options);

  static constexpr std::uint64_t memoryBytes() {
    return sizeof(CacheMonitor) + WindowRecord::memoryBytes();
  }

  // How receivers are taken, for the record.
  void noteRuns(std::uint64_t run_receivers, std::uint64_t prefetch_receivers) {
    run_receivers_.store(run_receivers, std::memory_order_relaxed);
    prefetch_receivers_.store(prefetch_receivers, std::memory_order_relaxed);
  }

  // A look at the caches: the one before, and now.
  struct Tick {
    Moment before, now;
    bool is_long;  // every kTicksPerHalving-th
  };
  // `receivers` more are done. Looks at the caches when it is time, in one thread at once.
  std::optional<Tick> advance(std::uint64_t receivers);
  // Closes the last window.
  void finish();

  std::uint64_t receivers() const { return receivers_.load(std::memory_order_relaxed); }
  // Windows so far; with `has_last` one that ends now, too.
  std::vector<GatherWindow> windows(bool has_last = false) const;
  GatherCacheStats nodeStats() const;
  GatherCacheStats surfelStats() const;

  Moment now() const;
  double seconds() const;

  // Sets both frame limits, and the least that the split keeps of each.
  void setFrames(std::size_t node_frames, std::size_t surfel_frames, std::size_t least_node_frames,
                 std::size_t least_surfel_frames);

  // What a load of a page took.
  static double secondsPerLoad(const CacheCounters& counters);
  static std::uint64_t loads(const CacheCounters& counters) {
    return counters.misses + counters.prefetches;
  }

 private:
  using Clock = std::chrono::steady_clock;

  // All below: mutex_ held
  void adaptSplit(const Moment& now);
  void noteWorkingSets(bool is_whole);

  OctreeCaches& caches_;
  const Clock::time_point start_ = Clock::now();
  std::atomic<std::uint64_t> receivers_{0};
  std::atomic<std::uint64_t> run_receivers_{0}, prefetch_receivers_{0};
  std::atomic<std::int64_t> next_tick_ns_;  // since start_

  mutable std::mutex mutex_;
  Options options_;
  std::size_t frame_bytes_ = 0;  // of both caches together, however they are split
  Moment last_tick_;
  CacheCounters first_nodes_, first_surfels_;  // at the beginning, of warm caches
  std::uint64_t ticks_ = 0;
  // Bytes of the pages touched in the last kTicksPerHalving ticks
  std::uint64_t node_working_set_bytes_ = 0, surfel_working_set_bytes_ = 0;
  WindowRecord record_;
};

}  // namespace surfeit
