#include "batch/receiver_queue.h"

#include <algorithm>
#include <span>

namespace surfeit {

ReceiverQueue::ReceiverQueue(ExternalSorter& sorter, std::size_t buffer_receivers,
                             std::uint64_t count)
    : sorter_(sorter), left_(count), buffer_(buffer_receivers) {}

Status ReceiverQueue::take(std::vector<SortedReceiver>& run, std::size_t count) {
  const std::lock_guard lock(mutex_);
  run.clear();
  if (end_ - begin_ < std::max(count, buffer_.size() / 2)) SURFEIT_RETURN_IF_ERROR(refill());
  count = std::min(count, end_ - begin_);
  const auto first = buffer_.begin() + static_cast<std::ptrdiff_t>(begin_);
  run.assign(first, first + static_cast<std::ptrdiff_t>(count));
  begin_ += count;
  taken_ += count;
  return {};
}

// Fills the buffer behind what is left in it.
Status ReceiverQueue::refill() {
  if (left_ == 0) return {};
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
            buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
  end_ -= begin_;
  begin_ = 0;
  const std::size_t room =
      static_cast<std::size_t>(std::min<std::uint64_t>(buffer_.size() - end_, left_));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           sorter_.next(std::span(buffer_).subspan(end_, room)));
  left_ = count < room ? 0 : left_ - count;
  end_ += count;
  return {};
}

std::optional<LocalReceiver> ReceiverQueue::lookAhead(std::uint64_t ahead, std::uint64_t stride) {
  const std::lock_guard lock(mutex_);
  next_look_ = std::max(next_look_, taken_);
  const std::uint64_t place = next_look_ - taken_;
  if (place >= ahead || place >= end_ - begin_) return std::nullopt;
  next_look_ += stride;
  return buffer_[begin_ + place].receiver;
}

}  // namespace surfeit
