// An LRU cache of decoded pages in frames of one size. It knows page numbers and a loader, not
// files. docs/architecture.md, "Life of a page", tells how gather, caches and file fit together.
//
//   page -> entry   dense table, as page numbers are dense: an atomic word
//                   [ frame : 32 | pins : 28 | seen : 1 | state : 3 ], and the page's epoch
//   frames          FramePool; those in use are the first ones, so that resident bytes equal the
//                   budget, and what a lower limit frees goes back to the system
//   epochs          a few misses each, at most a 2048th of the frames. Whoever lets go of a page
//                   stamps it with the epoch; the page stamped longest ago goes first. That is LRU
//                   but for the order within an epoch, and a hit moves no list. Misses are those of
//                   a true LRU within 1.1 % on every trace tried
//                   (tests/cache/cache_policy_test.cpp)
//   fronts          a thread's own window (cache/cache_front.h). The pages in it are announced, and
//                   whoever evicts looks at the announcements of all: hazard pointers (Michael,
//                   IEEE TPDS 2004), with the barrier on the side of the rare eviction.
//
// A look-up of a loaded page takes no lock, and through a front it writes nothing that threads
// share, but for the stamp once per epoch. A miss puts a placeholder into the word and loads
// outside the lock; other threads that want the same page wait for that page only. A failed load
// wakes them with its Status and is not cached.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "cache/cache_counters.h"
#include "cache/frame_lists.h"
#include "cache/frame_pool.h"
#include "cache/page_number.h"
#include "cache/zeroed_table.h"
#include "core/assert.h"
#include "surfeit/status.h"

namespace surfeit {

class CacheFront;
class ReuseDistances;

// Safe from any thread, but for keepResident. Its memory is memoryBytes() and no more: what is held
// in fronts and pins lies in the frames.
class PageCache {
 public:
  struct Options {
    // Pages that exist: numbers 0 .. page_count - 1. An entry of the table takes memory when its
    // page, or a neighbour, is first looked up.
    PageNumber page_count = 0;
    std::size_t frame_bytes = 0;  // most bytes of a decoded page
    std::size_t frame_count = 0;  // frames at first; see setFrameLimit
    // Told of the look-ups that fronts do not answer; may be null. Must outlive the cache.
    ReuseDistances* reuse_distances = nullptr;
    // Most frames that setFrameLimit may ever allow, for which address space is reserved; 0 stands
    // for one per page, as does anything above that.
    std::size_t most_frames = 0;
  };

  // What a loader made of a page.
  struct Loaded {
    std::uint32_t stored_bytes = 0;   // read from the file
    std::uint32_t decoded_bytes = 0;  // written to the frame
  };
  // Decodes `page` into `frame` (frame_bytes long, aligned to 64 bytes, contents undefined). Called
  // without any lock held, from the thread that missed, never for one page twice at a time. What it
  // throws becomes a kFailed; it must not use the cache.
  using Loader = std::function<Result<Loaded>(PageNumber page, std::span<std::byte> frame)>;

  // A page held in memory. Move-only; given back when destroyed. Data is immutable meanwhile. One
  // thread at a time, any thread.
  class Pin {
   public:
    Pin() = default;
    Pin(Pin&& other) noexcept
        : cache_(std::exchange(other.cache_, nullptr)), page_(other.page_), data_(other.data_) {}
    Pin& operator=(Pin&& other) noexcept {
      Pin old(std::move(*this));
      cache_ = std::exchange(other.cache_, nullptr);
      page_ = other.page_;
      data_ = other.data_;
      return *this;
    }
    ~Pin() { release(); }
    explicit operator bool() const { return cache_ != nullptr; }
    // As many bytes as the loader said.
    std::span<const std::byte> data() const { return data_; }
    void release() {
      if (cache_ != nullptr) std::exchange(cache_, nullptr)->unpin(page_, data_.data());
    }

   private:
    friend class PageCache;
    Pin(PageCache* cache, PageNumber page, std::span<const std::byte> data)
        : cache_(cache), page_(page), data_(data) {}

    PageCache* cache_ = nullptr;
    PageNumber page_ = 0;
    std::span<const std::byte> data_;
  };

  // Bytes that a frame takes: FramePool::strideFor.
  static std::size_t frameBytes(std::size_t decoded_bytes) {
    return FramePool::strideFor(decoded_bytes);
  }
  // Memory that a cache of these options takes when full: frames and tables.
  static std::size_t memoryBytes(const Options& options);

  // kBudgetTooSmall without a frame, kFailed when the address space cannot be had. May throw
  // std::bad_alloc, as may keepResident and setFrameLimit, which then have changed nothing.
  static Result<std::unique_ptr<PageCache>> create(const Options& options, Loader loader);
  PageCache(const PageCache&) = delete;
  PageCache& operator=(const PageCache&) = delete;
  // All pins and fronts must be gone.
  ~PageCache();

  // Loads pages 0 .. count - 1 and holds them as long as the cache lives. Fronts made later find
  // them without a look-up. Once, before other threads use the cache; the loads are counted as
  // prefetches. kBudgetTooSmall when that leaves no frame for the other pages, else the Status of
  // the loader; then none is held, and it may be tried again.
  Status keepResident(PageNumber count);

  // Changes the number of frames in use: at least one more than pages are kept resident, at most
  // Options::most_frames. Where it falls, pages are evicted, the others move to the first frames,
  // and the memory beyond goes back to the system: at once, or where pages are pinned or in a
  // front, when they are let go of. Takes the time of a copy per page that moves. Safe from any
  // thread.
  void setFrameLimit(std::size_t frames);

  // Forgets `count` pages from `first` on: their frames are free, and one that is loaded next under
  // such a number was never there before. None of them may be pinned, in a front or being loaded.
  // Safe from any thread.
  void forget(PageNumber first, PageNumber count);

  // Safe from any thread. Counts of a moment: those of fronts may be a few look-ups old.
  CacheCounters counters() const;
  std::size_t frameLimit() const;
  PageNumber pageCount() const { return options_.page_count; }
  bool isLoaded(PageNumber page) const;  // at this moment

 private:
  friend class CacheFront;

  // Low bits of a page's word.
  enum State : std::uint64_t {
    kAbsent = 0,   // no frame
    kLoading = 1,  // a frame is being filled; pins: the thread that fills it and all that wait
    kLoaded = 2,   // a frame holds the page
    kFailed = 3,   // loading failed; pins: the thread that loaded and those yet to be told why
    kLeaving = 4,  // a frame holds the page, but only a thread with the lock may have it back
  };
  static constexpr std::uint64_t kStateMask = 7;
  static constexpr std::uint64_t kSeen = 8;  // was loaded before: another load is a repeated one
  static constexpr int kPinShift = 4, kFrameShift = 32;
  static constexpr std::uint64_t kOnePin = std::uint64_t{1} << kPinShift;
  static constexpr std::uint64_t kPinMask = (std::uint64_t{1} << kFrameShift) - kOnePin;

  using Word = std::uint64_t;
  static State stateOf(Word word) { return static_cast<State>(word & kStateMask); }
  static std::uint32_t frameOf(Word word) {
    return static_cast<std::uint32_t>(word >> kFrameShift);
  }
  static bool isPinned(Word word) { return (word & kPinMask) != 0; }

  // One cache line is all that a look-up reads of the table.
  struct alignas(16) Entry {
    std::atomic<Word> word{0};
    std::atomic<std::uint32_t> epoch{0};  // when it was let go of last
    std::uint32_t decoded_bytes = 0;      // of a loaded page
  };

  // Epochs that a full cache lives through before its oldest page goes, about; and lists for more
  // than can ever hold a frame at once. Fewer epochs cost misses where a stream that nearly fits
  // repeats itself: 15 % with 128 epochs, 4 % with 512, 0.5 % with 2048.
  static constexpr std::uint32_t kEpochsInCache = 2048, kEpochLists = 8192;
  // The list of pages that are leaving, oldest first. Evicting takes a barrier in every thread, so
  // some pages are made ready for it at a time: a 128th of the frames, and no more than this.
  static constexpr std::uint32_t kLeavingList = kEpochLists;
  static constexpr std::size_t kMostLeaving = 32;

  // A frame in use is in the list of an epoch no later than that of its page, where it looks for
  // its place when its turn comes, or in that of the leaving.
  static constexpr std::uint32_t kNone = FrameLists::kNone;
  struct Frame {
    PageNumber page = kNone;          // kNone: not in use
    std::uint32_t next_free = kNone;  // in the list of free frames
    std::uint32_t held_in_scan = 0;   // the last scan of fronts that met it
    const Status* failure = nullptr;  // of a page that is kFailed
  };

  PageCache(const Options& options, FramePool pool, Loader loader);

  std::span<const std::byte> dataOf(PageNumber page, Word word) const {
    return {pool_.data(frameOf(word)), entries_[page].decoded_bytes};
  }

  // Adds a pin when the page is loaded. No lock.
  bool tryPin(PageNumber page, Pin& pin) {
    std::atomic<Word>& at = entries_[page].word;
    Word word = at.load(std::memory_order_relaxed);
    while (stateOf(word) == kLoaded) {
      if (at.compare_exchange_weak(word, word + kOnePin, std::memory_order_acquire,
                                   std::memory_order_relaxed)) {
        pin = Pin(this, page, dataOf(page, word));
        return true;
      }
    }
    return false;
  }

  // The page's data when it is loaded, else none. The caller has announced the page, so that nobody
  // evicts it afterwards; see CacheFront::announce.
  std::span<const std::byte> findLoaded(PageNumber page) const {
    const Word word = entries_[page].word.load();
    if (stateOf(word) != kLoaded) return {};
    return dataOf(page, word);
  }

  // Notes that a page is in use now. Threads that use it together write the epoch once, no matter
  // how often they do. (Without a branch: which pages have it is beyond any prediction.)
  void stamp(PageNumber page) {
    const std::uint32_t epoch = epoch_.load(std::memory_order_relaxed);
    std::atomic<std::uint32_t> elsewhere;
    std::atomic<std::uint32_t>* const targets[] = {&entries_[page].epoch, &elsewhere};
    const bool has_it = targets[0]->load(std::memory_order_relaxed) == epoch;
    targets[has_it]->store(epoch, std::memory_order_relaxed);
  }

  // Gives a pin back. No lock, unless someone waits.
  void unpin(PageNumber page, const std::byte* data) {
    stamp(page);
    const Word before = entries_[page].word.fetch_sub(kOnePin);
    SURFEIT_ASSERT(isPinned(before));
    if ((before & kPinMask) == kOnePin) noteRelease(data);
  }

  // Must follow when a page was let go of, whose data was there: others may wait for that. They
  // announce it before they look at pins and fronts for the last time, and this thread has let go
  // before it looks for announcements: one of the two sees the other.
  void noteRelease(const std::byte* data) {
    const std::uint32_t awaited = releases_awaited_.load();
    if (awaited == 0) return;
    // What is over the limit waits for the frames beyond it alone
    if (awaited == kOverLimit && data < limit_end_.load(std::memory_order_relaxed)) return;
    useReleased();
  }
  void useReleased();

  // What pinOrLoad shall do, and what it did.
  struct Request {
    bool is_prefetch = false;
    bool may_wait = true;  // until a frame is released, when all are held
    enum class Outcome : std::uint8_t { kHit, kWaited, kMissed, kNoFrame } outcome = Outcome::kHit;
    std::uint64_t stall_ns = 0;  // spent on loading and waiting is added here
  };
  // Pins a page that was not loaded a moment ago. With every frame held it waits until one is
  // released, or, when it may not, says kNoFrame and returns no pin. Counts loads, nothing else.
  // Throws nothing.
  Result<Pin> pinOrLoad(PageNumber page, Request& request);

  // All below: mutex_ held. Loading:
  Pin takeBack(PageNumber page);
  std::uint32_t waitForFrame(std::unique_lock<std::mutex>& lock, std::uint64_t& stall_ns);
  Result<Pin> waitForLoad(std::unique_lock<std::mutex>& lock, PageNumber page);
  Result<Pin> load(std::unique_lock<std::mutex>& lock, PageNumber page, std::uint32_t frame,
                   Request& request);
  Result<Pin> fail(std::unique_lock<std::mutex>& lock, PageNumber page, std::uint32_t frame,
                   const Status& status);
  void countMiss();

  // Frames:
  std::uint32_t takeFrame();
  bool evictOne();
  std::size_t makeLeave(std::size_t most);
  bool tryMakeLeave(std::uint32_t frame);
  void awaitFronts() const;
  void markHeldByFronts();
  void keepHeldByFronts();
  void setFree(std::uint32_t frame);
  std::uint32_t popFree();
  // Frames beyond the limit (frame_limit.cpp):
  void shrink();
  void moveStrays();
  void giveBackAroundStrays();
  static std::uint32_t epochList(std::uint32_t epoch) { return epoch % kEpochLists; }
  std::uint32_t currentList() const { return epochList(epoch_); }

  // Written by create and keepResident alone, and read by every look-up
  const Options options_;  // normalised
  const Loader loader_;
  FramePool pool_;
  const bool has_barrier_;  // processBarrier
  ZeroedTable<Entry> entries_;
  std::vector<Pin> resident_pins_;
  std::vector<std::span<const std::byte>> resident_;  // pages that are always there

  // Written seldom, and read whenever a page is let go of
  std::atomic<std::uint32_t> epoch_{0};  // now; written with mutex_ held
  // Threads that wait for frame_released_, and kOverLimit while there are frames to give back
  static constexpr std::uint32_t kOverLimit = 1u << 31;
  std::atomic<std::uint32_t> releases_awaited_{0};
  std::atomic<const std::byte*> limit_end_;  // end of the frames below frame_limit_

  // Written on every miss: a cache line away from the above
  alignas(64) mutable std::mutex mutex_;
  std::condition_variable load_ended_;      // with mutex_: some page left kLoading or kFailed
  std::condition_variable frame_released_;  // with mutex_: takeFrame may succeed again

  // All below: guarded by mutex_
  std::vector<Frame> frames_;       // as many as were ever allowed
  FrameLists lists_;                // of epochs, and kLeavingList
  std::uint32_t oldest_epoch_ = 0;  // no list before it holds a frame
  std::size_t misses_in_epoch_ = 0, misses_per_epoch_ = 1;
  std::size_t frame_limit_ = 0;
  std::size_t frames_in_use_ = 0;      // hold a page or are being filled
  std::size_t leaving_ = 0;            // of these: in kLeavingList
  std::uint32_t free_frame_ = kNone;   // the first, through next_free, of those below frame_limit_
  std::vector<std::uint32_t> strays_;  // frames in use that are not below it, in order
  std::uint32_t stray_end_ = 0;        // no frame from here on is in use
  std::size_t peak_frames_ = 0;
  std::uint32_t scan_ = 0;  // scans of fronts so far
  CacheCounters counts_;    // those that are not counted in fronts, and those of fronts that went
  std::vector<const CacheFront*> fronts_;  // that exist
};

}  // namespace surfeit
