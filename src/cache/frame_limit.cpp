// How a PageCache comes to use fewer frames, or more, while others use it.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "cache/page_cache.h"

namespace surfeit {

void PageCache::setFrameLimit(std::size_t frames) {
  const std::lock_guard lock(mutex_);
  const std::size_t least = resident_.size() + 1;
  const std::size_t limit = std::min(std::max(frames, least), options_.most_frames);
  if (limit > frames_.size()) {
    frames_.reserve(limit);  // exactly, where resize would round up
    strays_.reserve(limit);
    lists_.reserve(limit);
    frames_.resize(limit);
  }
  frame_limit_ = limit;
  limit_end_.store(pool_.data(static_cast<std::uint32_t>(limit)), std::memory_order_relaxed);
  pool_.setLimit(limit);

  // Below the limit, what is not in use is free; above, what is in use is astray
  free_frame_ = kNone;
  for (std::size_t frame = limit; frame-- > 0;) {
    if (frames_[frame].page == kNone) {
      frames_[frame].next_free = std::exchange(free_frame_, static_cast<std::uint32_t>(frame));
    }
  }
  strays_.clear();
  stray_end_ = std::max(stray_end_, static_cast<std::uint32_t>(limit));
  for (std::size_t frame = limit; frame < stray_end_; ++frame) {
    strays_.push_back(static_cast<std::uint32_t>(frame));
  }
  shrink();
  frame_released_.notify_all();
}

// Evicts what is more than the limit, moves what lies beyond it, and gives the memory there back.
void PageCache::shrink() {
  if (frames_in_use_ <= frame_limit_ && strays_.empty()) return;
  releases_awaited_ |= kOverLimit;  // before pins and fronts are looked at; see noteRelease
  awaitFronts();
  while (frames_in_use_ > frame_limit_ && evictOne()) {
  }
  moveStrays();
  const auto is_empty = [this](std::uint32_t frame) { return frames_[frame].page == kNone; };
  if (std::erase_if(strays_, is_empty) > 0) giveBackAroundStrays();
  if (strays_.empty()) releases_awaited_ &= ~kOverLimit;
}

// Moves pages from beyond the limit to free frames below, but for those that are held.
void PageCache::moveStrays() {
  bool any = false;
  for (const std::uint32_t from : strays_) {
    const bool may_move = frames_[from].page != kNone && lists_.listOf(from) != kLeavingList;
    any = (may_move && tryMakeLeave(from)) || any;
  }
  if (any) keepHeldByFronts();

  for (const std::uint32_t from : strays_) {
    const PageNumber page = frames_[from].page;
    if (page == kNone) continue;
    std::atomic<Word>& at = entries_[page].word;
    Word word = at.load();
    if (stateOf(word) != kLeaving) continue;
    const std::span<const std::byte> data = dataOf(page, word);
    if (lists_.listOf(from) != kLeavingList) word ^= kLeaving ^ kLoaded;
    if (free_frame_ != kNone) {  // else there are more pages than the limit allows
      const std::uint32_t to = popFree();
      std::memcpy(pool_.data(to), data.data(), data.size());
      lists_.replace(from, to);
      frames_[to].page = std::exchange(frames_[from].page, kNone);
      word += (Word{to} - Word{from}) << kFrameShift;
    }
    at.store(word);
  }
}

// Strays are in order, and so are the gaps between them.
void PageCache::giveBackAroundStrays() {
  std::uint32_t begin = static_cast<std::uint32_t>(frame_limit_);
  for (const std::uint32_t stray : strays_) {
    pool_.giveBackBetween(begin, stray);
    begin = stray + 1;
  }
  pool_.giveBackFrom(begin);
  stray_end_ = begin;
}

}  // namespace surfeit
