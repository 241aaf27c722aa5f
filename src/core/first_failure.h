// What went wrong first, when several threads work on one thing.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <mutex>
#include <utility>

#include "surfeit/status.h"

namespace surfeit {

// Keeps one of the failures it is told of: that of the lowest place, of one place the first. Safe
// from any thread.
class FirstFailure {
 public:
  // place() when nothing has failed.
  static constexpr std::uint64_t kNowhere = std::numeric_limits<std::uint64_t>::max();

  // Keeps `status` unless it is ok or there is one of this or a lower place. Without a place the
  // first in time wins.
  void note(Status status, std::uint64_t place = 0) {
    if (status.ok()) return;
    const std::lock_guard lock(mutex_);
    if (place >= place_.load(std::memory_order_relaxed)) return;
    status_ = std::move(status);
    place_.store(place, std::memory_order_release);
  }

  // Both cost a load: for loops that end when others have failed.
  bool happened() const { return place() != kNowhere; }
  std::uint64_t place() const { return place_.load(std::memory_order_acquire); }

  // The failure so far, or ok.
  Status status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  mutable std::mutex mutex_;
  std::atomic<std::uint64_t> place_{kNowhere};
  Status status_;
};

}  // namespace surfeit
