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

#include "gather/gather_memory.h"
#include "gather/packet_cluster.h"
#include "gather/window_record.h"
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
    // For advice: the budget of the gather, the work that it was planned for, and what the job
    // takes beside it.
    std::uint64_t memory_bytes = 0;
    GatherWork work{};
    std::uint64_t beside_bytes = 0;
    std::uint64_t receivers = 0;  // that will be gathered
    std::size_t least_node_frames = 1, least_surfel_frames = 1;
  };

  static constexpr std::uint64_t kLeastRun = kClusterReceivers, kFirstRun = kClusterReceivers,
                                 kMostRun = 1024;
  static constexpr std::uint64_t kMostDepth = 8192;  // receivers

  // The octree has reuse distances. Both must outlive the controller.
  PagingController(PagedOctree& octree, const Options& options, Progress& progress);

  // Bytes that a controller takes.
  static constexpr std::uint64_t memoryBytes() {
    return sizeof(PagingController) + WindowRecord::memoryBytes();
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

  // Call after finish().
  std::vector<GatherWindow> windows() const { return record_.windows(); }
  GatherCacheStats nodeStats() const;
  GatherCacheStats surfelStats() const;

 private:
  using Clock = std::chrono::steady_clock;
  using Moment = WindowRecord::Moment;

  Moment now() const;
  // All below: mutex_ held
  void tick();
  void adaptRun(const Moment& now);
  void adaptPrefetch(const Moment& now);
  void adaptSplit(const Moment& now);
  void advise(const Moment& now) const;
  void noteWorkingSets(bool is_whole);
  double secondsSinceStart() const;

  PagedOctree& octree_;
  const Options options_;
  Progress& progress_;
  const Clock::time_point start_ = Clock::now();
  const std::size_t frame_bytes_;  // of both caches together, however they are split

  std::atomic<std::uint64_t> receivers_{0};
  std::atomic<std::uint64_t> run_receivers_{kFirstRun};
  std::atomic<std::uint64_t> prefetch_receivers_{0};
  std::atomic<std::int64_t> next_tick_ns_;  // since start_

  mutable std::mutex mutex_;
  Moment last_tick_;
  std::uint64_t ticks_ = 0;
  double usual_repeat_rate_ = -1;  // of past ticks, newer ones counting more; negative: none yet
  // Bytes of the pages touched in the last kTicksPerHalving ticks
  std::uint64_t node_working_set_bytes_ = 0, surfel_working_set_bytes_ = 0;
  WindowRecord record_;
};

}  // namespace surfeit
