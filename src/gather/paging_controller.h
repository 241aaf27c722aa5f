// Watches the caches during a gather and acts on what it sees: how long the runs of the curve are
// that threads work on, how far ahead pages are read, and how memory is split between the caches.
// docs/architecture.md, "The monitor", tells by which rules. No result depends on any of it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "cache/cache_counters.h"
#include "octree/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"

namespace surfeit {

// Safe from any thread.
class PagingController {
 public:
  struct Options {
    int threads = 1;
    bool adapts_split = true;
    bool prefetches = true;
    std::uint64_t memory_bytes = 0;  // the budget of the process, for advice
    std::uint64_t receivers = 0;     // that will be gathered
    std::size_t least_node_frames = 1, least_surfel_frames = 1;
  };

  static constexpr std::uint64_t kLeastRun = 16, kFirstRun = 64, kMostRun = 512;
  static constexpr std::uint64_t kMostDepth = 8192;  // receivers
  static constexpr std::size_t kMostWindows = 256;

  // The octree has reuse distances. Both must outlive the controller.
  PagingController(PagedOctree& octree, const Options& options, Progress& progress);

  // Bytes that a controller takes.
  static std::uint64_t memoryBytes();

  // Receivers that a thread takes at once.
  std::uint64_t runReceivers() const { return run_receivers_.load(std::memory_order_relaxed); }
  // How far ahead pages are read; 0: not at all.
  std::uint64_t prefetchReceivers() const {
    return prefetch_receivers_.load(std::memory_order_relaxed);
  }

  // `receivers` more are done. Looks at the caches when it is time. Returns true when it did.
  bool advance(std::uint64_t receivers);
  // The gather is over: closes the last window, and gives advice that was not given yet.
  void finish();

  // Call after finish().
  std::vector<GatherWindow> takeWindows() { return std::move(windows_); }
  GatherCacheStats nodeStats() const;
  GatherCacheStats surfelStats() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Counters {
    CacheCounters nodes, surfels;
    std::uint64_t receivers = 0;
    double seconds = 0;
  };

  // All below: mutex_ held
  Counters count() const;
  void tick();
  void adaptRun(const Counters& now);
  void adaptPrefetch(const Counters& now);
  void adaptSplit(const Counters& now);
  void advise(const Counters& now);
  void record(const Counters& now);
  void mergeWindows();
  double secondsSinceStart() const;

  PagedOctree& octree_;
  const Options options_;
  Progress& progress_;
  const Clock::time_point start_ = Clock::now();

  std::atomic<std::uint64_t> receivers_{0};
  std::atomic<std::uint64_t> run_receivers_{kFirstRun};
  std::atomic<std::uint64_t> prefetch_receivers_{0};
  std::atomic<std::int64_t> next_tick_ns_;  // since start_

  mutable std::mutex mutex_;
  Counters last_tick_, last_window_;
  std::uint64_t ticks_ = 0;
  double usual_repeat_rate_ = -1;  // of past ticks, newer ones counting more; negative: none yet
  bool has_advised_ = false;
  double window_seconds_;
  std::vector<GatherWindow> windows_;
};

}  // namespace surfeit
