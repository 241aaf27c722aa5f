// Reads pages before the gather asks for them: threads of their own walk the cuts of receivers some
// way ahead along the order, one of every few, and what these miss is loaded into the caches.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "batch/paging_controller.h"
#include "batch/receiver_queue.h"
#include "engine/world.h"
#include "surfeit/gather.h"

namespace surfeit {

// Its threads begin at once, and sleep while the controller wants nothing read ahead. Pages that
// cannot be read are left for the gather to find. Must go before all that it refers to.
class Prefetcher {
 public:
  // Enough for the latency of a disk; they hardly compute.
  static constexpr int kThreads = 4;
  // Of so many neighbours one is walked: they see nearly the same.
  static constexpr std::uint64_t kStride = 2 * kPacketReceivers;

  // `threads` of them; where none can be started there are fewer.
  Prefetcher(const World& world, ReceiverQueue& queue, const PagingController& controller,
             int threads);
  Prefetcher(const Prefetcher&) = delete;
  Prefetcher& operator=(const Prefetcher&) = delete;
  ~Prefetcher();

  // The gather has moved on. From any thread; costs nothing while nothing is wanted.
  void notify();

 private:
  void work();

  const World& world_;
  ReceiverQueue& queue_;
  const PagingController& controller_;
  std::mutex mutex_;
  std::condition_variable changed_;  // with mutex_
  bool ends_ = false;                // guarded by mutex_
  std::uint64_t moves_ = 0;          // guarded by mutex_
  std::vector<std::jthread> threads_;
};

}  // namespace surfeit
