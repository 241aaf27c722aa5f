// Hands sorted receivers to the threads of a gather, in runs of neighbours, and shows those that
// prefetch where the gather will be soon.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "batch/sorted_receiver.h"
#include "gather/rules/receiver.h"
#include "surfeit/status.h"

namespace surfeit {

// Safe from any thread.
class ReceiverQueue {
 public:
  static constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();

  // The next `count` receivers of `sorter`, or all that it has; it is finished, and not used by
  // anyone else meanwhile. Takes buffer_receivers * 56 bytes; runs are no longer than that.
  ReceiverQueue(ExternalSorter& sorter, std::size_t buffer_receivers, std::uint64_t count = kAll);

  // Replaces `run` by the next receivers, up to `count` of them; none at the end.
  Status take(std::vector<SortedReceiver>& run, std::size_t count);

  // A receiver for one that prefetches: the next of a stride of `stride` receivers that nobody has
  // looked at, if it is less than `ahead` receivers from the last one taken and in the buffer.
  std::optional<LocalReceiver> lookAhead(std::uint64_t ahead, std::uint64_t stride);

 private:
  // All: mutex_ held
  Status refill();

  ExternalSorter& sorter_;
  std::uint64_t left_;  // to be read from it

  std::mutex mutex_;
  std::vector<SortedReceiver> buffer_;
  std::size_t begin_ = 0, end_ = 0;  // of what is in the buffer
  std::uint64_t taken_ = 0;
  std::uint64_t next_look_ = 0;  // place in the order
};

}  // namespace surfeit
