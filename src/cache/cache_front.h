// A thread's own way into a PageCache: a small, direct-mapped window of pinned pages. A hit takes
// no lock and writes nothing shared.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cache/page_cache.h"

namespace surfeit {

// One thread at a time; must go before its cache.
//
// The page that a look-up displaces is released before the new one is pinned. So a front never
// holds more than `slots` pages. A front that finds every frame of the cache pinned lets go of all
// it holds before it waits for one; so threads that use one cache each through one front never wait
// for each other in a circle, were there a single frame. Where a thread uses two caches, see
// yieldTo.
//
// May throw std::bad_alloc: when made, and out of a look-up for the text of an error. Both leave
// the front and its cache as they were.
class alignas(64) CacheFront {
 public:
  enum class Role : std::uint8_t {
    kRequests,  // its look-ups are requests, its loads misses
    kPrefetch,  // its loads are prefetches, and nothing else is counted
  };

  // Holds up to `slots` pages (rounded down to a power of two, at least 1).
  CacheFront(PageCache& cache, std::size_t slots, Role role = Role::kRequests);
  CacheFront(const CacheFront&) = delete;
  CacheFront& operator=(const CacheFront&) = delete;
  ~CacheFront();

  // A thread that waits for a frame in this cache lets go of what `other`, a front of the same
  // thread, holds in another: of two caches that threads use together, one must yield to the other.
  // Which one goes by the data needed together: look-ups here end what `other` returned, never the
  // reverse. `other` must last as long as look-ups here.
  void yieldTo(CacheFront& other) { yields_to_ = &other; }

  // The page's data, valid until the next look-up through this front or one that yields to it.
  // kCorruption when page >= page_count, which counts nothing; else the Status of the loader.
  Result<std::span<const std::byte>> lookup(PageNumber page) {
    if (page < resident_.size()) {
      count(front_hits_);
      return resident_[page];
    }
    const Slot& slot = slots_[page & mask_];
    if (slot.page == page) {
      count(front_hits_);
      return slot.data;
    }
    if (takeLoaded(page)) return slot.data;
    return loadIntoSlot(page);
  }

  // Holds a page beyond the next look-up, in none of the slots. The caller must see to it that such
  // pins never take the last frame.
  Result<PageCache::Pin> pin(PageNumber page);

  // Gives all slots back. For threads that pause.
  void release();

 private:
  friend class PageCache;
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};  // unlike any page that is asked for
  static constexpr PageNumber kNoPage = 0xffffffffu;
  struct alignas(32) Slot {
    std::uint64_t page = kEmpty;
    std::span<const std::byte> data;
  };
  // Written by this front's thread alone, read by any.
  using Count = std::atomic<std::uint64_t>;
  static void count(Count& counter, std::uint64_t by = 1) {
    counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
  }

  // Tells all threads that a slot holds a page, or none, and no longer the one before. Must come
  // before the look at the page's word (PageCache::findLoaded), and before PageCache::noteRelease.
  void announce(std::size_t slot, PageNumber page) {
    if (cache_.has_barrier_) {
      // Whoever must see this issues the barrier for both: PageCache::awaitFronts
      announced_[slot].store(page, std::memory_order_release);
      std::atomic_signal_fence(std::memory_order_seq_cst);
    } else {
      announced_[slot].exchange(page);
    }
  }
  // From any thread that has the cache's lock.
  template <typename Visit>
  void forEachAnnounced(Visit&& visit) const {
    for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
      const PageNumber page = announced_[slot].load();
      if (page != kNoPage) visit(page);
    }
  }

  // Empties the slot of a page, and takes the page from the cache if it is loaded there.
  bool takeLoaded(PageNumber page);
  Result<std::span<const std::byte>> loadIntoSlot(PageNumber page);
  void noteReuse(PageNumber page) const;
  // Loads the page if need be, and waits for a frame when this thread holds none that others may be
  // waiting for.
  Result<PageCache::Pin> pinOrLoad(PageNumber page);
  Status noSuchPage(PageNumber page) const;
  void addTo(CacheCounters& counters) const;

  PageCache& cache_;
  const Role role_;
  std::span<const std::span<const std::byte>> resident_;
  std::vector<Slot> slots_;
  PageNumber mask_ = 0;
  CacheFront* yields_to_ = nullptr;
  std::unique_ptr<std::atomic<PageNumber>[]> announced_;  // pages of the slots, for other threads

  // What only this front can count
  Count front_hits_{0}, shared_hits_{0}, waits_{0}, stall_ns_{0};
};

}  // namespace surfeit
