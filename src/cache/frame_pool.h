// Memory for the frames of a cache: one block of address space that takes memory frame by frame, as
// they are first written, and gives it back exactly. No allocator stands between, which would keep
// what one thread freed from the next (1.3 to 2 times the budget with malloc's arenas).
#pragma once

#include <cstddef>
#include <cstdint>

#include "surfeit/status.h"

namespace surfeit {

// One thread at a time, but for data().
class FramePool {
 public:
  // Bytes from one frame to the next: the decoded bytes, rounded up to an odd number of cache
  // lines. Frames that start at multiples of the system page would have their first lines, which
  // every look-up reads, compete for the same few sets of the processor's caches (2 to 3 times
  // slower look-ups in a cache of 600 MiB).
  static std::size_t strideFor(std::size_t frame_bytes);

  // Reserves address space alone. kFailed when it cannot be had; throws std::bad_alloc for want of
  // memory for that message.
  static Result<FramePool> create(std::size_t stride, std::size_t frames);
  FramePool(FramePool&& other) noexcept;
  FramePool& operator=(FramePool&&) = delete;
  ~FramePool();

  // Aligned to 64 bytes. Zero, or what was written since memory was last given back.
  std::byte* data(std::uint32_t frame) const { return begin_ + std::size_t{frame} * stride_; }
  std::size_t stride() const { return stride_; }
  std::size_t frames() const { return frames_; }

  // The frames that will be used: memory of the others is not taken. Where the system allows, whole
  // blocks of 2 MiB below this limit are huge pages (1.5 to 2.5 times faster look-ups in large
  // caches, where small ones miss the translation buffer).
  void setLimit(std::size_t frames);

  // Give memory back to the system: all from a frame on, or what lies between two, `end` not
  // included. Bytes of other frames stay, and so does the rest of a system page that they have part
  // in. For frames beyond the limit alone: those below may lie in huge pages, of which no part is
  // given back.
  void giveBackFrom(std::uint32_t begin);
  void giveBackBetween(std::uint32_t begin, std::uint32_t end);

 private:
  FramePool(std::byte* mapping, std::size_t mapping_bytes, std::size_t stride, std::size_t frames);

  std::byte* mapping_;
  std::size_t mapping_bytes_;
  std::byte* begin_;  // aligned to 2 MiB
  std::size_t stride_, frames_;
  std::size_t huge_bytes_ = 0;   // from begin_ on, advised to be huge pages
  std::size_t taken_bytes_ = 0;  // from begin_ on: nothing beyond has memory
};

}  // namespace surfeit
