#include "cache/frame_pool.h"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

namespace surfeit {
namespace {

constexpr std::size_t kLineBytes = 64;     // a cache line, and the widest vector
constexpr std::size_t kSystemPage = 4096;  // what the system gives and takes back
constexpr std::size_t kHugePage = std::size_t{2} << 20;

std::size_t roundedUp(std::size_t bytes, std::size_t unit) {
  return (bytes + unit - 1) / unit * unit;
}

}  // namespace

std::size_t FramePool::strideFor(std::size_t frame_bytes) {
  constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max() / 2;  // and none has it
  const std::size_t lines = (std::min(frame_bytes, kMost) + kLineBytes - 1) / kLineBytes;
  return (lines | 1) * kLineBytes;
}

Result<FramePool> FramePool::create(std::size_t stride, std::size_t frames) {
  if (frames > (std::numeric_limits<std::size_t>::max() - kHugePage) / stride) {
    return Status::failed(fmt::format(
        "cannot reserve {} frames of {} bytes: more than can be addressed", frames, stride));
  }
  const std::size_t bytes = frames * stride + kHugePage;
  void* mapping = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                       MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (mapping == MAP_FAILED) {
    return Status::failed(fmt::format("cannot reserve {} frames of {} bytes: {}", frames, stride,
                                      std::strerror(errno)));
  }
  return FramePool(static_cast<std::byte*>(mapping), bytes, stride, frames);
}

FramePool::FramePool(std::byte* mapping, std::size_t mapping_bytes, std::size_t stride,
                     std::size_t frames)
    : mapping_(mapping), mapping_bytes_(mapping_bytes), stride_(stride), frames_(frames) {
  const auto address = reinterpret_cast<std::uintptr_t>(mapping);
  begin_ = mapping + (roundedUp(address, kHugePage) - address);
}

FramePool::FramePool(FramePool&& other) noexcept
    : mapping_(std::exchange(other.mapping_, nullptr)),
      mapping_bytes_(other.mapping_bytes_),
      begin_(other.begin_),
      stride_(other.stride_),
      frames_(other.frames_),
      huge_bytes_(other.huge_bytes_),
      taken_bytes_(other.taken_bytes_) {}

FramePool::~FramePool() {
  if (mapping_ != nullptr) munmap(mapping_, mapping_bytes_);
}

// Advice that the system does not take, on huge pages or below, costs speed or memory, never
// correctness.
void FramePool::setLimit(std::size_t frames) {
  // Whole blocks alone, or a huge page would take memory beyond the limit
  const std::size_t bytes = std::min(frames, frames_) * stride_ / kHugePage * kHugePage;
  if (bytes > huge_bytes_) {
    madvise(begin_ + huge_bytes_, bytes - huge_bytes_, MADV_HUGEPAGE);
  } else if (bytes < huge_bytes_) {
    // Or the system might fill the gaps that giveBack leaves
    madvise(begin_ + bytes, huge_bytes_ - bytes, MADV_NOHUGEPAGE);
  }
  huge_bytes_ = bytes;
  taken_bytes_ =
      std::max(taken_bytes_, roundedUp(std::min(frames, frames_) * stride_, kSystemPage));
}

void FramePool::giveBackFrom(std::uint32_t begin) {
  const std::size_t first = roundedUp(begin * stride_, kSystemPage);
  if (first >= taken_bytes_) return;
  madvise(begin_ + first, taken_bytes_ - first, MADV_DONTNEED);
  taken_bytes_ = first;
}

void FramePool::giveBackBetween(std::uint32_t begin, std::uint32_t end) {
  const std::size_t first = roundedUp(begin * stride_, kSystemPage);
  const std::size_t last = end * stride_ / kSystemPage * kSystemPage;
  if (first < last) madvise(begin_ + first, last - first, MADV_DONTNEED);
}

}  // namespace surfeit
