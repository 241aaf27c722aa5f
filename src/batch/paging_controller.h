// Acts on what the monitor of the caches sees during a gather (engine/cache_monitor.h): how long
// the runs of the curve are that threads work on, and how far ahead pages are read.
// docs/architecture.md, "The monitor", tells by which rules. No result depends on any of it.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>

#include "batch/gather_memory.h"
#include "engine/cache_monitor.h"
#include "engine/world.h"
#include "gather/cut/packet_cluster.h"
#include "octree/read/octree_caches.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"

namespace surfeit {

// Safe from any thread.
class PagingController {
 public:
  struct Options {
    int threads = 1;
    bool prefetches = true;
    bool is_warm = false;  // an earlier gather has used the caches
    // For advice: the budget of the gather, the work that it was planned for, and what the job
    // takes beside it.
    std::uint64_t memory_bytes = 0;
    GatherWork work{};
    std::uint64_t beside_bytes = 0;
    std::uint64_t receivers = 0;  // that will be gathered
  };

  static constexpr std::uint64_t kLeastRun = kClusterReceivers, kFirstRun = kClusterReceivers,
                                 kMostRun = 1024;
  static constexpr std::uint64_t kMostDepth = 8192;  // receivers

  // The caches of the world track pages. Both must outlive the controller.
  PagingController(const World& world, const Options& options, Progress& progress);

  // Bytes that a controller takes, and the monitor.
  static constexpr std::uint64_t memoryBytes() {
    return sizeof(PagingController) + CacheMonitor::memoryBytes();
  }

  // Receivers that a thread takes at once.
  std::uint64_t runReceivers() const { return run_receivers_.load(std::memory_order_relaxed); }
  // How far ahead pages are read; 0: not at all.
  std::uint64_t prefetchReceivers() const {
    return prefetch_receivers_.load(std::memory_order_relaxed);
  }

  // `receivers` more are done. Looks at the caches when it is time.
  void advance(std::uint64_t receivers);
  // The gather is over: closes the last window, and tells what more memory would save. Not before,
  // for only all look-ups tell what budget would do.
  void finish();

 private:
  using Tick = CacheMonitor::Tick;

  // All below: mutex_ held
  void adaptRun(const Tick& tick);
  void adaptPrefetch(const Tick& tick);
  void advise() const;

  const SceneFile& file_;
  OctreeCaches& caches_;
  CacheMonitor& monitor_;
  const Options options_;
  Progress& progress_;
  std::atomic<std::uint64_t> run_receivers_{kFirstRun};
  std::atomic<std::uint64_t> prefetch_receivers_{0};
  std::mutex mutex_;
  double usual_repeat_rate_ = -1;  // of past ticks, newer ones counting more; negative: none yet
};

}  // namespace surfeit
