// An LRU cache of decoded pages in frames of one size. It knows page numbers and a loader, not
// files. docs/architecture.md, "Life of a page", tells how gather, caches and file fit together.
//
//   page -> frame   dense table, one entry per page of the file (page numbers are dense)
//   frames          one block of address space, touched frame by frame as the cache fills, so that
//                   resident bytes equal the budget; never given back to the allocator
//   LRU list        holds exactly the loaded frames that nobody pins; least recently unpinned first
//
// A miss puts a placeholder into the table and loads outside the lock; other threads that want the
// same page wait for that page only. A failed load wakes them with its Status and is not cached.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

using PageNumber = std::uint32_t;

// What a cache has done so far. hits + misses == requests.
struct CacheCounters {
  std::uint64_t requests = 0;
  std::uint64_t hits = 0;           // found loaded, being loaded by another thread, or in a front
  std::uint64_t misses = 0;         // loads started
  std::uint64_t evictions = 0;      // loaded pages given up for others
  std::uint64_t bytes_read = 0;     // stored bytes of the pages loaded, as the loader reports them
  std::uint64_t peak_bytes = 0;     // most frame bytes in use at any time
  std::uint64_t budget_bytes = 0;   // of all frames in the pool
  std::uint64_t decoded_bytes = 0;  // of the frames that would hold every page
};

class PageCache {
 public:
  struct Options {
    PageNumber page_count = 0;    // pages that exist: numbers 0 .. page_count - 1
    std::size_t frame_bytes = 0;  // size of a frame; rounded up to 64 bytes
    std::size_t frame_count = 0;  // frames in the pool; more than page_count are never used
  };

  // Decodes `page` into `frame` (frame_bytes long, 64-byte aligned, contents undefined) and returns
  // the stored bytes it read. Called without any lock held, from the thread that missed, never
  // for one page twice at a time.
  using Loader = std::function<Result<std::uint64_t>(PageNumber page, std::span<std::byte> frame)>;

  // A page held in memory. Move-only; given back when destroyed. Data is immutable meanwhile.
  class Pin {
   public:
    Pin() = default;
    Pin(Pin&& other) noexcept;
    Pin& operator=(Pin&& other) noexcept;
    ~Pin();
    explicit operator bool() const { return cache_ != nullptr; }
    const std::byte* data() const { return data_; }
    void release();

   private:
    friend class PageCache;
    Pin(PageCache* cache, const std::byte* data, std::uint32_t frame)
        : cache_(cache), data_(data), frame_(frame) {}

    PageCache* cache_ = nullptr;
    const std::byte* data_ = nullptr;
    std::uint32_t frame_ = 0;
  };

  // Memory that a cache of these options takes when full: frames and tables.
  static std::size_t memoryBytes(const Options& options);

  // kFailed when the address space cannot be had.
  static Result<std::unique_ptr<PageCache>> create(const Options& options, Loader loader);
  PageCache(const PageCache&) = delete;
  PageCache& operator=(const PageCache&) = delete;
  ~PageCache();

  // Loads the page if need be and holds it. Safe from any thread. The caller must see to it that
  // the pins of all threads together never take the last frame: a miss with every frame pinned
  // waits until one is released. kCorruption when page >= page_count, kBudgetTooSmall when the
  // pool has no frame at all; both are not counted as requests.
  Result<Pin> pin(PageNumber page);

  // Adds requests that a front answered without asking the cache. Safe from any thread.
  void addFrontHits(std::uint64_t count);

  CacheCounters counters() const;
  // As asked for, with the rounding and the limit on frames that Options tells of.
  const Options& options() const { return options_; }

 private:
  // What a frame holds. Only a loaded frame is ever without pins, and then in the LRU list.
  enum class FrameState : std::uint8_t {
    kFree,     // nothing: in the free list, or never used
    kLoading,  // being filled by the thread that missed; threads that wait hold pins too
    kLoaded,   // its page
    kFailed,   // nothing, but threads that waited still have to collect the Status
  };
  struct Frame {
    PageNumber page = 0;
    std::uint32_t pins = 0;
    std::uint32_t previous = 0, next = 0;  // in the LRU list; `next` also in the free list
    FrameState state = FrameState::kFree;
  };
  static constexpr std::uint32_t kNoFrame = 0xffffffffu;

  PageCache(const Options& options, std::byte* pool, Loader loader);

  std::byte* frameData(std::uint32_t frame) const {
    return pool_ + std::size_t{frame} * options_.frame_bytes;
  }

  // All below: mutex_ held
  Result<Pin> pinPresent(std::unique_lock<std::mutex>& lock, std::uint32_t frame);
  Result<Pin> load(std::unique_lock<std::mutex>& lock, PageNumber page, std::uint32_t frame);
  std::uint32_t takeFrame();
  void freeFrame(std::uint32_t frame);
  void linkMostRecent(std::uint32_t frame);
  void unlink(std::uint32_t frame);

  void unpin(std::uint32_t frame);  // takes mutex_

  const Options options_;
  const Loader loader_;
  std::byte* const pool_;  // frame_count * frame_bytes, mapped

  mutable std::mutex mutex_;
  std::condition_variable load_ended_;      // with mutex_: some frame left kLoading
  std::condition_variable frame_released_;  // with mutex_: takeFrame may succeed again

  // All below: guarded by mutex_
  std::vector<std::uint32_t> frame_of_page_;  // kNoFrame: neither loaded nor loading
  std::vector<Frame> frames_;                 // the last one is head and tail of the LRU list
  std::uint32_t untouched_frame_ = 0;         // this frame and those above were never used
  std::uint32_t free_frame_ = kNoFrame;       // first of the used frames that hold nothing
  std::uint32_t waiting_for_frame_ = 0;       // threads that wait for frame_released_
  std::unordered_map<std::uint32_t, Status> failures_;  // of frames that are kFailed
  std::uint64_t hits_ = 0, misses_ = 0, evictions_ = 0, bytes_read_ = 0;

  std::atomic<std::uint64_t> front_hits_{0};
};

// A thread's own small, direct-mapped window of pinned pages in front of a PageCache: a hit takes
// no lock and writes nothing shared. One thread at a time; must go before its cache.
//
// The page that a lookup displaces is released before the new one is pinned. So a front never holds
// more than `slots` pins, and where the pool has a frame for every slot of all its fronts, no
// lookup ever waits for a frame.
class CacheFront {
 public:
  // Holds up to `slots` pins (rounded down to a power of two, at least 1).
  CacheFront(PageCache& cache, std::size_t slots);
  CacheFront(const CacheFront&) = delete;
  CacheFront& operator=(const CacheFront&) = delete;
  ~CacheFront();

  // The page's data, valid until the next lookup through this front.
  Result<const std::byte*> lookup(PageNumber page) {
    const Slot& slot = slots_[page & mask_];
    if (slot.page != page || !slot.pin) return lookupInCache(page);
    if (++uncounted_hits_ == kHitsPerCount) countHits();
    return slot.pin.data();
  }

 private:
  struct Slot {
    PageNumber page = 0;
    PageCache::Pin pin;
  };
  // Often enough for a monitor to watch, seldom enough that the shared counter costs nothing.
  static constexpr std::uint32_t kHitsPerCount = 4096;

  Result<const std::byte*> lookupInCache(PageNumber page);
  void countHits();

  PageCache& cache_;
  std::vector<Slot> slots_;
  PageNumber mask_ = 0;
  std::uint32_t uncounted_hits_ = 0;
};

}  // namespace surfeit
