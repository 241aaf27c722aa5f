// Watches a stream of page look-ups and tells how an LRU cache of any size would have done on it:
// the miss-ratio curve from one run. A look-up is a hit exactly when fewer other pages were looked
// up since the last look-up of its page than the cache has frames (Mattson et al., "Evaluation
// Techniques for Storage Hierarchies", 1970). That count is the reuse distance.
//
// Few pages tell enough: with one page in S watched, and distances counted in watched pages, the
// curve of all pages is the same stretched by S (Waldspurger et al., "Efficient MRC Construction
// with SHARDS", FAST 2015). Which pages are watched depends on their numbers alone.
//
//   for every look-up that reaches the cache (those that a thread's own front answers do not):
//     if (distances.isSampled(page)) distances.touch(page);
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "cache/miss_ratio_curve.h"
#include "cache/page_number.h"

namespace surfeit {

// Safe from any thread. Look-ups of several threads count in the order in which they come; nothing
// but predictions may depend on the result.
//
// Measured with 100,000 pages (tests/cache/reuse_distances_test.cpp): how far predicted miss ratios
// are off, in the mean over sizes from 1 % of the pages to all of them. Below some S frames they
// are a guess.
//
//   watched   sweeps, loops, tree paths, uniform   Zipf's law, pages in random order
//    4,096    0.003 or less                        0.010 on average, 0.024 at worst
//   16,384    0.002 or less                        0.006 on average, 0.011 at worst
class ReuseDistances {
 public:
  static constexpr std::size_t kMostTracked = std::size_t{1} << 28;

  // Watches one page of every S = pagesPerSample(), the smallest S with at most `most_tracked`
  // pages watched (at least 1, at most kMostTracked), and all pages when they are no more than
  // that.
  ReuseDistances(PageNumber page_count, std::size_t most_tracked);
  ReuseDistances(const ReuseDistances&) = delete;
  ReuseDistances& operator=(const ReuseDistances&) = delete;

  // All the memory of such an object, which never grows: about 21 bytes per watched page.
  static std::size_t memoryBytes(PageNumber page_count, std::size_t most_tracked);

  std::uint32_t pagesPerSample() const { return pages_per_sample_; }

  // Whether the look-ups of a page are wanted. Takes no lock and writes nothing; about 1 ns.
  //
  // Of each run of S page numbers one is chosen, by a hash of the run. Neighbouring pages are
  // neighbours on the curve, or of one level, and are used alike. So the sample is more even than
  // one of independent pages, yet no stride can fall in step with it.
  bool isSampled(PageNumber page) const {
    if (pages_per_sample_ == 1) return true;
    const std::uint32_t run = page / pages_per_sample_;
    return page - run * pages_per_sample_ == chosenOf(run);
  }

  // A look-up of `page`, which must be sampled and less than page_count. Locks; O(log watched
  // pages), and allocates nothing.
  void touch(PageNumber page);

  // What caches would have missed of all look-ups so far. `lookups` is their true number, sampled
  // or not; look-ups answered by fronts may be included or not.
  MissRatioCurve curve(std::uint64_t lookups) const;

  // Windows over time: a window ends and the next begins. Look-ups of the past count half from now
  // on in recentCurve. `lookups` in both is again the number of all look-ups so far, as for curve.
  void endWindow(std::uint64_t lookups);
  MissRatioCurve recentCurve(std::uint64_t lookups) const;

  // The working set of this window: about how many different pages were looked up in it so far.
  std::uint64_t windowPages() const;

  // Sampled look-ups so far.
  std::uint64_t touches() const;

 private:
  static constexpr std::uint32_t kNever = 0xffffffffu;
  static constexpr std::uint32_t kWordSlots = 64;  // slots per word of the bit set

  // Sizes of the arrays.
  struct Plan {
    Plan(PageNumber page_count, std::size_t most_tracked);
    std::uint32_t pages_per_sample;
    std::uint32_t tracked;  // runs, the last of which may be shorter and have no page to watch
    std::uint32_t words;
  };
  explicit ReuseDistances(const Plan& plan);

  // Position within its run of the page that is watched: the high bits of a hash, scaled to 0 .. S
  // - 1. The hash is the finalizer of MurmurHash3 but for its last step, which only helps low bits.
  std::uint32_t chosenOf(std::uint32_t run) const {
    std::uint32_t hash = run + 0x9e3779b9u;
    hash = (hash ^ hash >> 16) * 0x85ebca6bu;
    hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
    return std::uint32_t(std::uint64_t{hash} * pages_per_sample_ >> 32);
  }

  // All below: mutex_ held
  std::uint32_t slotsBefore(std::uint32_t slot) const;
  void addToTree(std::uint32_t word, std::uint32_t difference);
  void insertSlot(std::uint32_t slot);
  void eraseSlot(std::uint32_t slot);
  void renumberSlots();
  double recentLookups(std::uint64_t lookups) const;

  const std::uint32_t pages_per_sample_;

  mutable std::mutex mutex_;

  // All below: guarded by mutex_. Every touch takes the next time slot, and the slot of the last
  // touch of each page is marked. The marks after a slot are the pages touched since then, each
  // once.
  std::vector<std::uint32_t> slot_of_page_;  // by run of pages; kNever before the first touch
  std::vector<std::uint64_t> marks_;         // a bit for every slot
  std::vector<std::uint32_t> tree_;          // Fenwick tree over the marks of each word, from 1
  std::uint32_t next_slot_ = 0;              // slots from here on are free; none: renumber
  std::uint32_t marked_ = 0;                 // pages with a slot
  std::uint32_t window_slot_ = 0;            // first slot of the window
  std::uint32_t window_pages_ = 0;           // watched pages touched in the window

  // Touches by reuse distance. Those of recent_ are halved at every window. Doubles count whole
  // numbers exactly to 2^53, and halve them exactly, so that sums depend on no order.
  struct Touches {
    std::vector<double> reuses;
    double first = 0;
    double lookups = 0;  // recent_ only: before this window
  };
  Touches all_, recent_;
  std::uint64_t touches_ = 0;
  std::uint64_t lookups_before_window_ = 0;
};

}  // namespace surfeit
