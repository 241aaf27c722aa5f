#include "cache/page_cache.h"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <exception>
#include <limits>
#include <utility>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr std::size_t kFrameAlignment = 64;  // a cache line, and the widest vector

// The options as the cache works by them: whole cache lines, and no frame that could stay unused.
PageCache::Options normalised(PageCache::Options options) {
  const std::size_t lines = (options.frame_bytes + kFrameAlignment - 1) / kFrameAlignment;
  options.frame_bytes = std::max<std::size_t>(lines, 1) * kFrameAlignment;
  options.frame_count = std::min<std::size_t>(options.frame_count, options.page_count);
  return options;
}

// A loader is code from elsewhere: were it to throw past the cache, the threads that wait for the
// page would wait for ever.
Result<std::uint64_t> callLoader(const PageCache::Loader& loader, PageNumber page,
                                 std::span<std::byte> frame) {
  try {
    return loader(page, frame);
  } catch (const std::exception& exception) {
    return Status::failed(fmt::format("cannot load page {}: {}", page, exception.what()));
  }
}

}  // namespace

PageCache::Pin::Pin(Pin&& other) noexcept
    : cache_(std::exchange(other.cache_, nullptr)),
      data_(std::exchange(other.data_, nullptr)),
      frame_(other.frame_) {}

PageCache::Pin& PageCache::Pin::operator=(Pin&& other) noexcept {
  if (this != &other) {
    release();
    cache_ = std::exchange(other.cache_, nullptr);
    data_ = std::exchange(other.data_, nullptr);
    frame_ = other.frame_;
  }
  return *this;
}

PageCache::Pin::~Pin() { release(); }

void PageCache::Pin::release() {
  if (cache_ != nullptr) cache_->unpin(frame_);
  cache_ = nullptr;
  data_ = nullptr;
}

std::size_t PageCache::memoryBytes(const Options& options) {
  const Options used = normalised(options);
  return used.frame_count * used.frame_bytes + (used.frame_count + 1) * sizeof(Frame) +
         std::size_t{used.page_count} * sizeof(std::uint32_t);
}

Result<std::unique_ptr<PageCache>> PageCache::create(const Options& options, Loader loader) {
  const Options used = normalised(options);
  if (used.frame_count > std::numeric_limits<std::size_t>::max() / used.frame_bytes) {
    return Status::failed(
        fmt::format("cannot reserve {} frames of {} bytes: more than can be addressed",
                    used.frame_count, used.frame_bytes));
  }

  // Address space alone: the kernel gives memory to a frame when it is first written
  std::byte* pool = nullptr;
  const std::size_t pool_bytes = used.frame_count * used.frame_bytes;
  if (pool_bytes > 0) {
    void* mapped = mmap(nullptr, pool_bytes, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapped == MAP_FAILED) {
      return Status::failed(fmt::format("cannot reserve {} frames of {} bytes: {}",
                                        used.frame_count, used.frame_bytes, std::strerror(errno)));
    }
    pool = static_cast<std::byte*>(mapped);
  }
  return std::unique_ptr<PageCache>(new PageCache(used, pool, std::move(loader)));
}

PageCache::PageCache(const Options& options, std::byte* pool, Loader loader)
    : options_(options),
      loader_(std::move(loader)),
      pool_(pool),
      frame_of_page_(options.page_count, kNoFrame),
      frames_(options.frame_count + 1) {
  // The LRU list is a ring through the last entry, empty when that entry links to itself
  const std::uint32_t ring = static_cast<std::uint32_t>(options.frame_count);
  frames_[ring].previous = frames_[ring].next = ring;
}

PageCache::~PageCache() {
  for (const Frame& frame : frames_) SURFEIT_ASSERT(frame.pins == 0);
  if (pool_ != nullptr) munmap(pool_, options_.frame_count * options_.frame_bytes);
}

Result<PageCache::Pin> PageCache::pin(PageNumber page) {
  if (page >= options_.page_count) {
    return Status::corruption(
        fmt::format("page {} does not exist: expected less than {}", page, options_.page_count));
  }
  if (options_.frame_count == 0) {
    return Status::budgetTooSmall(
        fmt::format("the cache has no frame for page {}: expected at least one of {} bytes", page,
                    options_.frame_bytes));
  }

  std::unique_lock lock(mutex_);
  for (;;) {
    if (const std::uint32_t frame = frame_of_page_[page]; frame != kNoFrame) {
      return pinPresent(lock, frame);
    }
    if (const std::uint32_t frame = takeFrame(); frame != kNoFrame) {
      return load(lock, page, frame);
    }
    // Every frame is pinned. By the time one is released another thread may have begun to load
    // this very page, so we look again from the start.
    ++waiting_for_frame_;
    frame_released_.wait(lock);
    --waiting_for_frame_;
  }
}

// Pins a page that is loaded, or waits for the thread that loads it.
Result<PageCache::Pin> PageCache::pinPresent(std::unique_lock<std::mutex>& lock,
                                             std::uint32_t index) {
  Frame& frame = frames_[index];
  ++hits_;
  if (frame.pins++ == 0) unlink(index);

  // Our pin keeps the frame from being used for anything else while we wait, also when it fails
  while (frame.state == FrameState::kLoading) load_ended_.wait(lock);
  if (frame.state == FrameState::kLoaded) return Pin(this, frameData(index), index);

  // The last thread to collect the Status gives up the frame
  SURFEIT_ASSERT(frame.state == FrameState::kFailed);
  const auto failure = failures_.find(index);
  Status status = failure->second;
  if (--frame.pins == 0) {
    failures_.erase(failure);
    freeFrame(index);
  }
  return status;
}

// Fills a frame that takeFrame returned. Meanwhile the table shows the page as present, so that
// every other thread that wants it ends up in pinPresent.
Result<PageCache::Pin> PageCache::load(std::unique_lock<std::mutex>& lock, PageNumber page,
                                       std::uint32_t index) {
  Frame& frame = frames_[index];
  ++misses_;
  frame.page = page;
  frame.pins = 1;
  frame.state = FrameState::kLoading;
  frame_of_page_[page] = index;

  lock.unlock();
  const Result<std::uint64_t> bytes_read =
      callLoader(loader_, page, {frameData(index), options_.frame_bytes});
  lock.lock();

  if (bytes_read.ok()) {
    bytes_read_ += *bytes_read;
    frame.state = FrameState::kLoaded;
    load_ended_.notify_all();
    return Pin(this, frameData(index), index);
  }

  // Forget the page at once, so that whoever asks next tries again
  frame_of_page_[page] = kNoFrame;
  if (--frame.pins == 0) {
    freeFrame(index);
  } else {
    frame.state = FrameState::kFailed;
    failures_.emplace(index, bytes_read.status());
    load_ended_.notify_all();
  }
  return bytes_read.status();
}

// A frame for a new page, or kNoFrame when all are pinned. Frames that were written before come
// first and untouched ones in order, so that resident memory is never more than the peak in use.
std::uint32_t PageCache::takeFrame() {
  if (free_frame_ != kNoFrame) {
    return std::exchange(free_frame_, frames_[free_frame_].next);
  }
  if (untouched_frame_ < options_.frame_count) return untouched_frame_++;

  const std::uint32_t ring = static_cast<std::uint32_t>(options_.frame_count);
  const std::uint32_t victim = frames_[ring].next;
  if (victim == ring) return kNoFrame;
  unlink(victim);
  frame_of_page_[frames_[victim].page] = kNoFrame;
  ++evictions_;
  return victim;
}

void PageCache::freeFrame(std::uint32_t frame) {
  frames_[frame].state = FrameState::kFree;
  frames_[frame].next = std::exchange(free_frame_, frame);
  if (waiting_for_frame_ > 0) frame_released_.notify_all();
}

void PageCache::unpin(std::uint32_t frame) {
  const std::lock_guard lock(mutex_);
  SURFEIT_ASSERT(frames_[frame].pins > 0);
  if (--frames_[frame].pins > 0) return;
  linkMostRecent(frame);
  // All of them: one that finds its page loaded by now would leave the frame to nobody
  if (waiting_for_frame_ > 0) frame_released_.notify_all();
}

void PageCache::linkMostRecent(std::uint32_t frame) {
  const std::uint32_t ring = static_cast<std::uint32_t>(options_.frame_count);
  frames_[frame].next = ring;
  frames_[frame].previous = frames_[ring].previous;
  frames_[frames_[ring].previous].next = frame;
  frames_[ring].previous = frame;
}

void PageCache::unlink(std::uint32_t frame) {
  frames_[frames_[frame].previous].next = frames_[frame].next;
  frames_[frames_[frame].next].previous = frames_[frame].previous;
}

void PageCache::addFrontHits(std::uint64_t count) {
  front_hits_.fetch_add(count, std::memory_order_relaxed);
}

CacheCounters PageCache::counters() const {
  const std::lock_guard lock(mutex_);
  CacheCounters counters;
  counters.hits = hits_ + front_hits_.load(std::memory_order_relaxed);
  counters.misses = misses_;
  counters.requests = counters.hits + counters.misses;
  counters.evictions = evictions_;
  counters.bytes_read = bytes_read_;
  // Used frames are reused before untouched ones, so as many were in use at once
  counters.peak_bytes = std::uint64_t{untouched_frame_} * options_.frame_bytes;
  counters.budget_bytes = std::uint64_t{options_.frame_count} * options_.frame_bytes;
  counters.decoded_bytes = std::uint64_t{options_.page_count} * options_.frame_bytes;
  return counters;
}

CacheFront::CacheFront(PageCache& cache, std::size_t slots)
    : cache_(cache), slots_(std::bit_floor(std::max<std::size_t>(slots, 1))) {
  mask_ = static_cast<PageNumber>(slots_.size() - 1);
}

CacheFront::~CacheFront() { countHits(); }

Result<const std::byte*> CacheFront::lookupInCache(PageNumber page) {
  Slot& slot = slots_[page & mask_];
  slot.pin.release();
  SURFEIT_ASSIGN_OR_RETURN(slot.pin, cache_.pin(page));
  slot.page = page;
  return slot.pin.data();
}

void CacheFront::countHits() {
  cache_.addFrontHits(uncounted_hits_);
  uncounted_hits_ = 0;
}

}  // namespace surfeit
