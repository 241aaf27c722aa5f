#include "cache/page_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <list>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

namespace surfeit {
namespace {

constexpr std::size_t kFrameBytes = 256;
constexpr std::uint64_t kStoredBytes = 100;  // what the loader says it read for a page

// Fills the whole frame with its page number, so that a frame changed too early is seen.
Result<std::uint64_t> loadNumber(PageNumber page, std::span<std::byte> frame) {
  for (std::size_t at = 0; at < frame.size(); at += sizeof page) {
    std::memcpy(frame.data() + at, &page, sizeof page);
  }
  return kStoredBytes;
}

// Whether a whole frame carries the page number.
bool holds(const std::byte* data, PageNumber page) {
  for (std::size_t at = 0; at < kFrameBytes; at += sizeof page) {
    if (std::memcmp(data + at, &page, sizeof page) != 0) return false;
  }
  return true;
}

std::unique_ptr<PageCache> makeCache(PageNumber pages, std::size_t frames,
                                     PageCache::Loader loader = loadNumber) {
  auto cache = PageCache::create({pages, kFrameBytes, frames}, std::move(loader));
  EXPECT_TRUE(cache.ok()) << cache.status().message();
  return std::move(*cache);
}

// A gate that a loader waits at. Closed until open() is called; gives up after ten seconds, so
// that a broken cache fails the test instead of hanging it.
class Gate {
 public:
  void open() { open_ = true; }
  void waitUntilOpen() const {
    waitFor([this] { return open_.load(); });
  }

  template <typename Condition>
  static bool waitFor(Condition condition) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::yield();
    }
    return true;
  }

 private:
  std::atomic<bool> open_{false};
};

// The reference: a plain LRU of page numbers.
class ModelLru {
 public:
  explicit ModelLru(std::size_t capacity) : capacity_(capacity) {}

  bool request(PageNumber page) {
    const auto found = std::find(pages_.begin(), pages_.end(), page);
    const bool hit = found != pages_.end();
    if (hit) pages_.erase(found);
    if (!hit && pages_.size() == capacity_) pages_.pop_front();
    pages_.push_back(page);
    return hit;
  }

 private:
  std::size_t capacity_;
  std::list<PageNumber> pages_;  // least recent first
};

TEST(PageCache, LruOrderEqualsTheNaiveModel) {
  for (const std::size_t frames : {1, 2, 7, 64, 200}) {
    auto cache = makeCache(200, frames);
    ModelLru model(frames);
    std::mt19937 random(static_cast<unsigned>(frames));
    // Squaring favours low pages, so that hits and misses mix at every size
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 20000; ++i) {
      const double at = uniform(random);
      const PageNumber page = static_cast<PageNumber>(at * at * 200);
      const std::uint64_t misses_before = cache->counters().misses;
      const auto pin = cache->pin(page);
      ASSERT_TRUE(pin.ok());
      ASSERT_TRUE(holds(pin->data(), page));
      ASSERT_EQ(model.request(page), cache->counters().misses == misses_before)
          << "request " << i << ", " << frames << " frames";
    }
  }
}

TEST(PageCache, PinnedPagesSurviveEviction) {
  auto cache = makeCache(100, 4);
  std::vector<PageCache::Pin> pins;
  for (const PageNumber page : {10u, 20u, 30u}) pins.push_back(std::move(*cache->pin(page)));
  for (PageNumber page = 0; page < 100; ++page) ASSERT_TRUE(cache->pin(page).ok());
  EXPECT_TRUE(holds(pins[0].data(), 10));
  EXPECT_TRUE(holds(pins[1].data(), 20));
  EXPECT_TRUE(holds(pins[2].data(), 30));
  EXPECT_EQ(cache->counters().misses, 100u);  // the three were hits when their turn came
}

TEST(PageCache, PinMovesAndReleasesOnce) {
  auto cache = makeCache(10, 1);
  PageCache::Pin first = std::move(*cache->pin(1));
  PageCache::Pin second = std::move(first);
  EXPECT_FALSE(first);  // NOLINT: a moved-from pin is an empty one
  EXPECT_TRUE(second);
  EXPECT_TRUE(holds(second.data(), 1));
  first.release();
  second.release();
  EXPECT_FALSE(second);
  EXPECT_EQ(second.data(), nullptr);

  // The frame is free again, and assignment releases what the pin held before
  second = std::move(*cache->pin(2));
  second = PageCache::Pin();
  EXPECT_TRUE(cache->pin(3).ok());
}

TEST(PageCache, FramesAreTouchedInOrderAndAligned) {
  auto cache = makeCache(100, 10);
  std::vector<PageCache::Pin> pins;
  for (PageNumber page = 0; page < 5; ++page) pins.push_back(std::move(*cache->pin(page)));
  for (std::size_t i = 0; i < pins.size(); ++i) {
    EXPECT_EQ(pins[i].data(), pins[0].data() + i * kFrameBytes);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(pins[i].data()) % 64, 0u);
  }
  EXPECT_EQ(cache->counters().peak_bytes, 5 * kFrameBytes);
}

TEST(PageCache, CountersAddUp) {
  auto cache = makeCache(50, 8);
  std::mt19937 random(5);
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(cache->pin(random() % 50).ok());
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.requests, 1000u);
  EXPECT_EQ(counters.hits + counters.misses, 1000u);
  EXPECT_EQ(counters.evictions, counters.misses - 8);
  EXPECT_EQ(counters.bytes_read, counters.misses * kStoredBytes);
  EXPECT_EQ(counters.peak_bytes, 8 * kFrameBytes);
  EXPECT_EQ(counters.budget_bytes, 8 * kFrameBytes);
  EXPECT_EQ(counters.decoded_bytes, 50 * kFrameBytes);
}

TEST(PageCache, EveryFrameCountFromNoneToAllWorks) {
  // No frame: an error, not a wait for ever
  auto none = makeCache(10, 0);
  EXPECT_EQ(none->pin(3).status().code(), StatusCode::kBudgetTooSmall);
  EXPECT_EQ(none->counters().requests, 0u);

  auto one = makeCache(10, 1);
  for (PageNumber page = 0; page < 10; ++page) {
    const auto pin = one->pin(page);
    ASSERT_TRUE(pin.ok());
    EXPECT_TRUE(holds(pin->data(), page));
  }
  EXPECT_EQ(one->counters().evictions, 9u);

  // More frames than pages are never used, nor counted
  auto all = makeCache(10, 1000);
  EXPECT_EQ(all->options().frame_count, 10u);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(all->pin(PageNumber(i % 10)).ok());
  EXPECT_EQ(all->counters().misses, 10u);
  EXPECT_EQ(all->counters().evictions, 0u);
}

TEST(PageCache, PageOutOfRangeIsCorruption) {
  auto cache = makeCache(10, 4);
  EXPECT_EQ(cache->pin(10).status().code(), StatusCode::kCorruption);
  EXPECT_EQ(cache->pin(0xffffffffu).status().code(), StatusCode::kCorruption);
  CacheFront front(*cache, 4);
  EXPECT_EQ(front.lookup(0xffffffffu).status().code(), StatusCode::kCorruption);
  auto empty = makeCache(0, 4);
  EXPECT_EQ(empty->pin(0).status().code(), StatusCode::kCorruption);
}

TEST(PageCache, FrameSizesRoundUpToCacheLines) {
  for (const std::size_t bytes : {0, 1, 63, 64, 65, 4096}) {
    const auto cache = PageCache::create({2, bytes, 2}, loadNumber);
    ASSERT_TRUE(cache.ok());
    const std::size_t rounded = std::max<std::size_t>((bytes + 63) / 64, 1) * 64;
    EXPECT_EQ((*cache)->options().frame_bytes, rounded);
  }
}

TEST(PageCache, ImpossiblePoolFails) {
  const auto cache = PageCache::create({0xffffffffu, std::size_t{1} << 40, 1u << 31}, loadNumber);
  ASSERT_FALSE(cache.ok());
  EXPECT_EQ(cache.status().code(), StatusCode::kFailed);
}

TEST(PageCache, MemoryBytesCountsFramesAndTables) {
  const std::size_t some = PageCache::memoryBytes({1000, 4096, 100});
  // 4 bytes per page; of a frame its data and at most 24 bytes
  EXPECT_GE(some, 1000 * 4 + 100 * 4096);
  EXPECT_LE(some, 1000 * 4 + 101 * (4096 + 24) - 4096);
  EXPECT_EQ(PageCache::memoryBytes({2000, 4096, 100}) - some, 1000u * 4);
  EXPECT_EQ(PageCache::memoryBytes({10, 64, 1000}), PageCache::memoryBytes({10, 64, 10}));
}

TEST(PageCache, TwoThreadsMissingOnePageLoadItOnce) {
  Gate gate;
  std::atomic<int> loads{0};
  auto cache = makeCache(10, 4, [&](PageNumber page, std::span<std::byte> frame) {
    ++loads;
    gate.waitUntilOpen();
    return loadNumber(page, frame);
  });

  std::atomic<int> right{0};
  const auto request = [&] {
    const auto pin = cache->pin(7);
    if (pin.ok() && holds(pin->data(), 7)) ++right;
  };
  std::thread first(request), second(request);
  // Both have asked, one of them loads
  EXPECT_TRUE(Gate::waitFor([&] { return cache->counters().requests == 2; }));
  gate.open();
  first.join();
  second.join();
  EXPECT_EQ(right, 2);
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(cache->counters().misses, 1u);
  EXPECT_EQ(cache->counters().hits, 1u);
}

TEST(PageCache, OtherPagesAreServedWhileOneLoads) {
  Gate gate;
  auto cache = makeCache(10, 4, [&](PageNumber page, std::span<std::byte> frame) {
    if (page == 7) gate.waitUntilOpen();
    return loadNumber(page, frame);
  });
  std::thread slow([&] { EXPECT_TRUE(cache->pin(7).ok()); });
  EXPECT_TRUE(Gate::waitFor([&] { return cache->counters().misses == 1; }));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(cache->pin(3).ok());
  EXPECT_EQ(cache->counters().hits, 2u);
  gate.open();
  slow.join();
}

TEST(PageCache, FailedLoadReachesAllWaitersAndIsNotCached) {
  Gate gate;
  std::atomic<bool> broken{true};
  auto cache =
      makeCache(10, 2, [&](PageNumber page, std::span<std::byte> frame) -> Result<std::uint64_t> {
        if (broken && page == 7) {
          gate.waitUntilOpen();
          return Status::corruption("page 7: checksum");
        }
        return loadNumber(page, frame);
      });

  std::atomic<int> told{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const auto pin = cache->pin(7);
      if (!pin.ok() && pin.status().code() == StatusCode::kCorruption &&
          pin.status().message() == "page 7: checksum") {
        ++told;
      }
    });
  }
  EXPECT_TRUE(Gate::waitFor([&] { return cache->counters().requests == 4; }));
  gate.open();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(told, 4);
  EXPECT_EQ(cache->counters().misses, 1u);
  EXPECT_EQ(cache->counters().bytes_read, 0u);

  // It fails again as long as it is broken, and works afterwards; no frame was lost
  EXPECT_FALSE(cache->pin(7).ok());
  broken = false;
  const auto retry = cache->pin(7);
  ASSERT_TRUE(retry.ok());
  EXPECT_TRUE(holds(retry->data(), 7));
  EXPECT_EQ(cache->counters().misses, 3u);
  EXPECT_TRUE(cache->pin(8).ok());
  EXPECT_EQ(cache->counters().peak_bytes, 2 * kFrameBytes);
}

TEST(PageCache, ThrowingLoaderIsAFailedLoad) {
  auto cache = makeCache(10, 1, [](PageNumber, std::span<std::byte>) -> Result<std::uint64_t> {
    throw std::runtime_error("out of something");
  });
  for (int i = 0; i < 3; ++i) {
    const auto pin = cache->pin(1);
    ASSERT_EQ(pin.status().code(), StatusCode::kFailed);
    EXPECT_EQ(pin.status().message(), "cannot load page 1: out of something");
  }
}

TEST(PageCache, MissWaitsWhileEveryFrameIsPinned) {
  auto cache = makeCache(10, 2);
  PageCache::Pin first = std::move(*cache->pin(1));
  PageCache::Pin second = std::move(*cache->pin(2));

  // Two threads want one page and a third another; a single frame comes free
  std::atomic<int> right{0};
  std::vector<std::thread> threads;
  for (const PageNumber page : {5u, 5u, 6u}) {
    threads.emplace_back([&cache, &right, page] {
      const auto pin = cache->pin(page);
      if (pin.ok() && holds(pin->data(), page)) ++right;
    });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(right, 0);
  EXPECT_EQ(cache->counters().misses, 2u);
  first.release();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 3);
  EXPECT_TRUE(holds(second.data(), 2));
}

TEST(CacheFront, HitsNeedNoCacheRequest) {
  auto cache = makeCache(100, 8);
  {
    CacheFront front(*cache, 4);
    for (int i = 0; i < 1000; ++i) {
      for (PageNumber page = 8; page < 12; ++page) {
        const auto data = front.lookup(page);
        ASSERT_TRUE(data.ok());
        ASSERT_TRUE(holds(*data, page));
      }
    }
    EXPECT_EQ(cache->counters().requests, 4u);  // the rest is counted when the front goes
  }
  EXPECT_EQ(cache->counters().requests, 4000u);
  EXPECT_EQ(cache->counters().misses, 4u);
}

TEST(CacheFront, HitsAreCountedWhileItLives) {
  auto cache = makeCache(10, 1);
  CacheFront front(*cache, 1);
  for (int i = 0; i < 100000; ++i) ASSERT_TRUE(front.lookup(3).ok());
  EXPECT_GT(cache->counters().requests, 90000u);
}

TEST(CacheFront, NeverHoldsMoreThanItsSlots) {
  // As many frames as slots: a front that pinned before it released would wait for itself
  for (const std::size_t slots : {1, 2, 3, 8}) {
    auto cache = makeCache(100, std::max<std::size_t>(slots & ~std::size_t{1}, 1));
    CacheFront front(*cache, slots);  // 3 becomes 2
    std::mt19937 random(1);
    for (int i = 0; i < 10000; ++i) {
      const PageNumber page = random() % 100;
      const auto data = front.lookup(page);
      ASSERT_TRUE(data.ok());
      ASSERT_TRUE(holds(*data, page));
    }
  }
}

TEST(CacheFront, FailedLookupLeavesTheFrontUsable) {
  std::atomic<bool> broken{true};
  auto cache =
      makeCache(10, 2, [&](PageNumber page, std::span<std::byte> frame) -> Result<std::uint64_t> {
        if (broken && page == 3) return Status::ioError("page 3");
        return loadNumber(page, frame);
      });
  CacheFront front(*cache, 2);
  ASSERT_TRUE(front.lookup(1).ok());
  EXPECT_EQ(front.lookup(3).status().code(), StatusCode::kIoError);
  EXPECT_EQ(front.lookup(3).status().code(), StatusCode::kIoError);
  broken = false;
  ASSERT_TRUE(front.lookup(3).ok());
  EXPECT_TRUE(holds(*front.lookup(3), 3));
  EXPECT_TRUE(holds(*front.lookup(1), 1));
}

// Large caches hide lifetime races: what finds them is a tiny cache, many threads, and pages that
// know their own number.
TEST(PageCache, TortureGivesNoWrongPage) {
  constexpr int kThreads = 4;
  constexpr PageNumber kPages = 2000;
  for (const std::size_t frames : {8, 9, 16, 33, 64}) {
    std::atomic<std::uint64_t> loads{0}, failures{0};
    std::vector<std::atomic<int>> loading(kPages);
    auto cache = makeCache(
        kPages, frames, [&](PageNumber page, std::span<std::byte> frame) -> Result<std::uint64_t> {
          EXPECT_EQ(loading[page].fetch_add(1), 0) << "page " << page << " loaded twice at a time";
          const std::uint64_t load = ++loads;
          auto result = loadNumber(page, frame);
          loading[page].fetch_sub(1);
          if (load % 97 != 0) return result;
          ++failures;
          return Status::ioError("injected");
        });

    // Each thread holds a front of one slot and up to one pin of its own
    std::atomic<std::uint64_t> wrong{0}, requests{0};
    std::vector<std::thread> threads;
    for (int id = 0; id < kThreads; ++id) {
      threads.emplace_back([&, id] {
        std::mt19937 random(static_cast<unsigned>(id));
        CacheFront front(*cache, 1);
        PageCache::Pin pin;
        PageNumber pinned_page = 0;
        std::uint64_t sent = 0;
        for (int i = 0; i < 20000; ++i, ++sent) {
          // Half the requests go to few pages, so that threads meet
          const PageNumber page = random() % 2 ? random() % 20 : random() % kPages;
          if (random() % 4 == 0) {
            pin.release();
            auto result = cache->pin(page);
            if (result.ok()) pin = std::move(*result), pinned_page = page;
          } else if (const auto data = front.lookup(page); data.ok()) {
            std::this_thread::yield();
            wrong += !holds(*data, page);
          }
          if (pin) wrong += !holds(pin.data(), pinned_page);
        }
        requests += sent;
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0u);

    const CacheCounters counters = cache->counters();
    EXPECT_EQ(counters.requests, requests);
    EXPECT_EQ(counters.hits + counters.misses, counters.requests);
    EXPECT_EQ(counters.misses, loads);
    EXPECT_EQ(counters.bytes_read, (loads - failures) * kStoredBytes);
    EXPECT_LE(counters.peak_bytes, frames * kFrameBytes);
    // No pin is left: every frame can be pinned again
    std::vector<PageCache::Pin> all;
    for (PageNumber page = 0; all.size() < frames; ++page) {
      if (auto pin = cache->pin(page); pin.ok()) all.push_back(std::move(*pin));
    }
  }
}

// With fewer frames than the threads would like to hold, misses wait for each other's pins.
TEST(PageCache, TortureWithFewerFramesThanThreadsEnds) {
  constexpr PageNumber kPages = 2000;
  for (const std::size_t frames : {1, 2, 3}) {
    auto cache = makeCache(kPages, frames);
    std::atomic<std::uint64_t> wrong{0};
    std::vector<std::thread> threads;
    for (unsigned id = 0; id < 4; ++id) {
      threads.emplace_back([&, id] {
        std::mt19937 random(id);
        for (int i = 0; i < 5000; ++i) {
          const PageNumber page = random() % 2 ? random() % 4 : random() % kPages;
          const auto pin = cache->pin(page);
          if (random() % 8 == 0) std::this_thread::yield();
          wrong += !pin.ok() || !holds(pin->data(), page);
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0u);
    EXPECT_EQ(cache->counters().requests, 20000u);
  }
}

}  // namespace
}  // namespace surfeit
