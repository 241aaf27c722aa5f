#include "cache/page_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <new>
#include <utility>

#include "cache/cache_front.h"
#include "cache/process_barrier.h"

namespace surfeit {
namespace {

// Adds the time it lives to a sum of nanoseconds.
class Stopwatch {
 public:
  explicit Stopwatch(std::uint64_t& sum) : sum_(sum) {}
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() {
    sum_ += static_cast<std::uint64_t>(std::chrono::nanoseconds(Clock::now() - begin_).count());
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::uint64_t& sum_;
  const Clock::time_point begin_ = Clock::now();
};

// The options as the cache works by them: no frame that could stay unused.
PageCache::Options normalised(PageCache::Options options) {
  const std::size_t pages = options.page_count;
  options.frame_count = std::min(options.frame_count, pages);
  if (options.most_frames == 0) options.most_frames = pages;
  options.most_frames = std::clamp(options.most_frames, options.frame_count, pages);
  return options;
}

// A loader is code from elsewhere: were it to throw past the cache, the threads that wait for the
// page would wait for ever.
Result<PageCache::Loaded> callLoader(const PageCache::Loader& loader, PageNumber page,
                                     std::span<std::byte> frame) noexcept {
  try {
    try {
      return loader(page, frame);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& exception) {
      return Status::failed(fmt::format("cannot load page {}: {}", page, exception.what()));
    } catch (...) {
      return Status::failed(fmt::format("cannot load page {}", page));
    }
  } catch (...) {
    return Status::failed("out of memory");  // so short a text takes none
  }
}

// A copy for another thread.
Status copyOf(const Status& status) noexcept {
  try {
    return status;
  } catch (const std::bad_alloc&) {
    return Status::failed("out of memory");
  }
}

}  // namespace

std::size_t PageCache::memoryBytes(const Options& options) {
  const Options used = normalised(options);
  return used.frame_count * (frameBytes(used.frame_bytes) + sizeof(Frame) + sizeof(std::uint32_t)) +
         used.page_count * sizeof(Entry) +
         FrameLists::memoryBytes(kEpochLists + 1, used.frame_count);
}

Result<std::unique_ptr<PageCache>> PageCache::create(const Options& options, Loader loader) {
  const Options used = normalised(options);
  if (used.frame_count == 0 && used.page_count > 0) {
    return Status::budgetTooSmall(
        fmt::format("a cache without a frame: expected at least one of {} bytes",
                    frameBytes(used.frame_bytes)));
  }
  SURFEIT_ASSIGN_OR_RETURN(FramePool pool,
                           FramePool::create(frameBytes(used.frame_bytes), used.most_frames));
  return std::unique_ptr<PageCache>(new PageCache(used, std::move(pool), std::move(loader)));
}

PageCache::PageCache(const Options& options, FramePool pool, Loader loader)
    : options_(options),
      loader_(std::move(loader)),
      pool_(std::move(pool)),
      has_barrier_(registerProcessBarrier()),
      entries_(options.page_count),
      lists_(kEpochLists + 1) {
  setFrameLimit(options.frame_count);
}

PageCache::~PageCache() {
  resident_pins_.clear();
  SURFEIT_ASSERT(fronts_.empty());
  for (const Frame& frame : frames_) {
    SURFEIT_ASSERT(frame.page == kNone || !isPinned(entries_[frame.page].word.load()));
  }
}

Status PageCache::keepResident(PageNumber count) {
  SURFEIT_CHECK(count <= options_.page_count && resident_.empty());
  const std::size_t limit = frameLimit();
  if (count >= limit && count > 0 && limit < options_.page_count) {
    return Status::budgetTooSmall(
        fmt::format("{} frames for {} pages kept resident and one for all others", limit, count));
  }
  std::vector<Pin> pins;
  std::vector<std::span<const std::byte>> resident;
  pins.reserve(count);
  resident.reserve(count);
  for (PageNumber page = 0; page < count; ++page) {
    Request request{.is_prefetch = true};
    SURFEIT_ASSIGN_OR_RETURN(Pin pin, pinOrLoad(page, request));
    resident.push_back(pin.data());
    pins.push_back(std::move(pin));
  }
  resident_pins_ = std::move(pins);
  resident_ = std::move(resident);
  return {};
}

void PageCache::forget(PageNumber first, PageNumber count) {
  SURFEIT_CHECK(first >= resident_.size() && count <= options_.page_count - first);
  const std::lock_guard lock(mutex_);
  for (PageNumber page = first; page < first + count; ++page) {
    Entry& entry = entries_[page];
    const Word word = entry.word.load();
    if (word == 0) continue;
    const State state = stateOf(word);
    SURFEIT_CHECK(!isPinned(word) && state != kLoading && state != kFailed);
    if (state != kAbsent) {
      const std::uint32_t frame = frameOf(word);
      if (state == kLeaving && lists_.listOf(frame) == kLeavingList) --leaving_;
      lists_.remove(frame);
      setFree(frame);
    }
    entry.word.store(0);
    entry.epoch.store(0, std::memory_order_relaxed);
  }
  shrink();
  frame_released_.notify_all();
}

CacheCounters PageCache::counters() const {
  const std::lock_guard lock(mutex_);
  CacheCounters counters = counts_;
  for (const CacheFront* front : fronts_) front->addTo(counters);
  counters.hits = counters.front_hits + counters.shared_hits;
  counters.requests = counters.hits + counters.misses;
  counters.peak_bytes = std::uint64_t{peak_frames_} * pool_.stride();
  counters.budget_bytes = std::uint64_t{frame_limit_} * pool_.stride();
  counters.decoded_bytes = std::uint64_t{options_.page_count} * pool_.stride();
  return counters;
}

std::size_t PageCache::frameLimit() const {
  const std::lock_guard lock(mutex_);
  return frame_limit_;
}

bool PageCache::isLoaded(PageNumber page) const {
  SURFEIT_ASSERT(page < options_.page_count);
  const State state = stateOf(entries_[page].word.load(std::memory_order_relaxed));
  return state == kLoaded || state == kLeaving;
}

void PageCache::useReleased() {
  const std::lock_guard lock(mutex_);
  shrink();
  frame_released_.notify_all();
}

Result<PageCache::Pin> PageCache::pinOrLoad(PageNumber page, Request& request) {
  using Outcome = Request::Outcome;
  std::unique_lock lock(mutex_);
  for (;;) {
    Pin pin;
    request.outcome = Outcome::kHit;
    if (tryPin(page, pin)) return pin;
    switch (stateOf(entries_[page].word.load(std::memory_order_relaxed))) {
      case kLeaving:
        return takeBack(page);
      case kLoading: {
        request.outcome = Outcome::kWaited;
        const Stopwatch watch(request.stall_ns);
        return waitForLoad(lock, page);
      }
      case kFailed: {  // and not all have been told: whoever comes later tries again
        const Stopwatch watch(request.stall_ns);
        load_ended_.wait(lock);
        continue;
      }
      default:
        break;
    }

    std::uint32_t frame = takeFrame();
    if (frame == kNone && request.may_wait) {
      frame = waitForFrame(lock, request.stall_ns);
      // Meanwhile another thread may have begun to load this very page
      if (frame == kNone) continue;
    }
    if (frame == kNone) {
      request.outcome = Outcome::kNoFrame;
      return Pin();
    }
    request.outcome = Outcome::kMissed;
    return load(lock, page, frame, request);
  }
}

// Pins a page that was about to be evicted.
PageCache::Pin PageCache::takeBack(PageNumber page) {
  std::atomic<Word>& at = entries_[page].word;
  const Word word = at.load();
  lists_.moveTo(frameOf(word), currentList());
  --leaving_;
  at.store((word ^ kLeaving ^ kLoaded) + kOnePin);
  return Pin(this, page, dataOf(page, word));
}

// Every frame was held. A frame that was released since is taken without waiting, and without
// letting go of the lock; kNone after waiting, for another attempt.
std::uint32_t PageCache::waitForFrame(std::unique_lock<std::mutex>& lock, std::uint64_t& stall_ns) {
  ++releases_awaited_;
  awaitFronts();
  const std::uint32_t frame = takeFrame();
  if (frame == kNone) {
    const Stopwatch watch(stall_ns);
    frame_released_.wait(lock);
  }
  --releases_awaited_;
  return frame;
}

// Waits for the thread that loads the page. The pin added here is handed out, or keeps the frame's
// failure from being forgotten before it is told.
Result<PageCache::Pin> PageCache::waitForLoad(std::unique_lock<std::mutex>& lock, PageNumber page) {
  std::atomic<Word>& at = entries_[page].word;
  at.fetch_add(kOnePin);
  while (stateOf(at) == kLoading) load_ended_.wait(lock);
  const Word word = at.load();
  if (stateOf(word) == kLoaded) return Pin(this, page, dataOf(page, word));

  SURFEIT_ASSERT(stateOf(word) == kFailed);
  Status status = copyOf(*frames_[frameOf(word)].failure);
  at.fetch_sub(kOnePin);
  load_ended_.notify_all();
  return status;
}

// Fills a frame that takeFrame returned. Meanwhile the word shows the page as being loaded, so that
// every other thread that wants it ends up in waitForLoad.
Result<PageCache::Pin> PageCache::load(std::unique_lock<std::mutex>& lock, PageNumber page,
                                       std::uint32_t index, Request& request) {
  std::atomic<Word>& at = entries_[page].word;
  const Word seen = at.load(std::memory_order_relaxed) & kSeen;
  countMiss();
  ++(request.is_prefetch ? counts_.prefetches : counts_.misses);
  stamp(page);
  frames_[index].page = page;
  lists_.append(index, currentList());
  at.store(Word{index} << kFrameShift | kOnePin | seen | kLoading, std::memory_order_relaxed);

  lock.unlock();
  std::uint64_t nanoseconds = 0;
  const Result<Loaded> loaded = [&] {
    const Stopwatch watch(nanoseconds);
    return callLoader(loader_, page, {pool_.data(index), options_.frame_bytes});
  }();
  lock.lock();
  counts_.load_ns += nanoseconds;
  request.stall_ns += nanoseconds;
  if (!loaded.ok()) return fail(lock, page, index, loaded.status());

  SURFEIT_ASSERT(loaded->decoded_bytes <= options_.frame_bytes);
  entries_[page].decoded_bytes = loaded->decoded_bytes;
  counts_.bytes_read += loaded->stored_bytes;
  if (seen != 0) {
    ++counts_.repeated_loads;
    counts_.repeated_bytes += loaded->stored_bytes;
  }
  // The pins of threads that wait stay; only state and seen change. Whoever finds it loaded finds
  // its data, too
  const Word before = at.fetch_xor((kLoading ^ kLoaded) | (seen ^ kSeen));
  if ((before & kPinMask) != kOnePin) load_ended_.notify_all();
  return Pin(this, page, dataOf(page, before));
}

// Forgets a page whose load failed, once all that wait for it have been told.
Result<PageCache::Pin> PageCache::fail(std::unique_lock<std::mutex>& lock, PageNumber page,
                                       std::uint32_t index, const Status& status) {
  std::atomic<Word>& at = entries_[page].word;
  ++counts_.failed_loads;
  frames_[index].failure = &status;
  at.fetch_xor(kLoading ^ kFailed);
  load_ended_.notify_all();
  while ((at.load() & kPinMask) != kOnePin) load_ended_.wait(lock);

  at.store(at.load() & kSeen);
  lists_.remove(index);
  setFree(index);
  shrink();
  load_ended_.notify_all();
  frame_released_.notify_all();
  return copyOf(status);
}

// An epoch ends after so many misses that the oldest page is about kEpochsInCache epochs old. That
// is a 2048th of the frames when misses turn the cache over, and less when it nearly holds all that
// is used, as then a page that goes was in use a few misses ago.
//
// A page goes before its epoch's list is used again: since it was stamped, every miss has loaded
// another one that stays longer, so that there were no more misses than frames. Only failed loads
// and a limit that changes again and again could break that; then an epoch lasts longer.
void PageCache::countMiss() {
  if (++misses_in_epoch_ < misses_per_epoch_) return;
  while (oldest_epoch_ != epoch_ && lists_.first(epochList(oldest_epoch_)) == kNone) {
    ++oldest_epoch_;
  }
  const std::uint32_t age = epoch_ - oldest_epoch_;
  if (age + 1 == kEpochLists) return;
  ++epoch_;
  misses_in_epoch_ = 0;
  const std::size_t most = std::max<std::size_t>(frame_limit_ / kEpochsInCache, 1);
  if (age < kEpochsInCache / 2 && frames_in_use_ == frame_limit_) misses_per_epoch_ /= 2;
  if (age > 2 * kEpochsInCache) misses_per_epoch_ *= 2;
  misses_per_epoch_ = std::clamp<std::size_t>(misses_per_epoch_, 1, most);
}

// A frame for a new page, or kNone when all are held.
std::uint32_t PageCache::takeFrame() {
  shrink();
  if (frames_in_use_ > frame_limit_) return kNone;
  if (frames_in_use_ == frame_limit_ && !evictOne()) return kNone;
  const std::uint32_t frame = popFree();
  peak_frames_ = std::max(peak_frames_, ++frames_in_use_);
  return frame;
}

// Frees the frame of the page that was let go of longest ago. False when all are held.
bool PageCache::evictOne() {
  while (leaving_ == 0) {
    const std::size_t most = std::clamp<std::size_t>(frame_limit_ / 128, 1, kMostLeaving);
    if (makeLeave(most) == 0) return false;
  }
  const std::uint32_t index = lists_.first(kLeavingList);
  std::atomic<Word>& at = entries_[frames_[index].page].word;
  at.store(at.load() & kSeen);
  lists_.remove(index);
  --leaving_;
  setFree(index);
  ++counts_.evictions;
  return true;
}

// Puts the oldest pages that nobody holds into the list of those that are leaving. 0 when all are
// held: none but held ones were met since the last of the others, as many as there are. Otherwise
// some may have been, though a front takes them back before this returns.
//
// Frames that are met before their time move to where they belong now, held ones to the end. So no
// more are looked at than twice those in use, but for pages that others use meanwhile, and few in
// the mean.
std::size_t PageCache::makeLeave(std::size_t most) {
  markHeldByFronts();
  const std::uint32_t now = epoch_;
  std::size_t made = 0;
  for (std::size_t held = 0; made < most && held < frames_in_use_ - leaving_;) {
    while (lists_.first(epochList(oldest_epoch_)) == kNone) ++oldest_epoch_;
    const std::uint32_t index = lists_.first(epochList(oldest_epoch_));
    const Entry& entry = entries_[frames_[index].page];
    const bool is_held = isPinned(entry.word.load()) || frames_[index].held_in_scan == scan_;
    // A thread that was stopped while it let go may have brought an epoch that is past already
    const std::uint32_t age = now - entry.epoch.load(std::memory_order_relaxed);
    if (!is_held && age >= now - oldest_epoch_) {
      if (!tryMakeLeave(index)) continue;  // it was pinned meanwhile
      lists_.moveTo(index, kLeavingList);
      ++leaving_;
      ++made;
      continue;
    }
    held = is_held ? held + 1 : 0;
    lists_.moveTo(index, epochList(is_held ? now : now - age));
  }
  if (made > 0) keepHeldByFronts();
  return made;
}

// Keeps threads without the lock from taking hold of a loaded page that has no pins. Fronts may
// have hold of it still: keepHeldByFronts must follow.
bool PageCache::tryMakeLeave(std::uint32_t index) {
  std::atomic<Word>& at = entries_[frames_[index].page].word;
  Word word = at.load();
  return stateOf(word) == kLoaded && !isPinned(word) &&
         at.compare_exchange_strong(word, word ^ kLoaded ^ kLeaving);
}

// What a front announced before, or has let go of, is seen after this.
void PageCache::awaitFronts() const {
  if (has_barrier_) processBarrier();
}

void PageCache::markHeldByFronts() {
  ++scan_;
  for (const CacheFront* front : fronts_) {
    front->forEachAnnounced([&](PageNumber page) {
      const Word word = entries_[page].word.load();
      if (stateOf(word) == kLoaded) frames_[frameOf(word)].held_in_scan = scan_;
    });
  }
}

// A front announces a page before it looks at the page's word: it has found the page leaving, and
// asks for the lock, or its announcement is seen here.
void PageCache::keepHeldByFronts() {
  awaitFronts();
  for (const CacheFront* front : fronts_) {
    front->forEachAnnounced([&](PageNumber page) {
      std::atomic<Word>& at = entries_[page].word;
      const Word word = at.load();
      if (stateOf(word) != kLeaving) return;
      if (lists_.listOf(frameOf(word)) == kLeavingList) --leaving_;
      lists_.moveTo(frameOf(word), currentList());
      at.store(word ^ kLeaving ^ kLoaded);
    });
  }
}

void PageCache::setFree(std::uint32_t index) {
  frames_[index].page = kNone;
  --frames_in_use_;
  if (index < frame_limit_) frames_[index].next_free = std::exchange(free_frame_, index);
}

std::uint32_t PageCache::popFree() {
  return std::exchange(free_frame_, frames_[free_frame_].next_free);
}

}  // namespace surfeit
