#include "cache/page_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <stdexcept>
#include <vector>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"

namespace surfeit {
namespace {

TEST(PageCache, PinnedPagesSurviveEviction) {
  auto cache = makeCache(100, 4);
  CacheFront front(*cache, 1);
  std::vector<PageCache::Pin> pins;
  for (const PageNumber page : {10u, 20u, 30u}) pins.push_back(std::move(*front.pin(page)));
  for (PageNumber page = 0; page < 100; ++page) ASSERT_TRUE(front.pin(page).ok());
  EXPECT_TRUE(holds(pins[0].data(), 10));
  EXPECT_TRUE(holds(pins[1].data(), 20));
  EXPECT_TRUE(holds(pins[2].data(), 30));
  EXPECT_EQ(cache->counters().misses, 100u);  // the three were hits when their turn came
}

TEST(PageCache, PinMovesAndReleasesOnce) {
  auto cache = makeCache(10, 1);
  CacheFront front(*cache, 1);
  PageCache::Pin first = std::move(*front.pin(1));
  PageCache::Pin second = std::move(first);
  EXPECT_FALSE(first);  // NOLINT: a moved-from pin is an empty one
  EXPECT_TRUE(second);
  EXPECT_TRUE(holds(second.data(), 1));
  first.release();
  second.release();
  EXPECT_FALSE(second);

  // The frame is free again, and assignment releases what the pin held before
  second = std::move(*front.pin(2));
  second = PageCache::Pin();
  EXPECT_TRUE(front.pin(3).ok());
}

TEST(PageCache, FramesAreUsedInOrderAndAligned) {
  auto cache = makeCache(100, 10);
  CacheFront front(*cache, 1);
  std::vector<PageCache::Pin> pins;
  for (PageNumber page = 0; page < 5; ++page) pins.push_back(std::move(*front.pin(page)));
  for (std::size_t i = 0; i < pins.size(); ++i) {
    EXPECT_EQ(pins[i].data().data(), pins[0].data().data() + frameBytes(i));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(pins[i].data().data()) % 64, 0u);
  }
  EXPECT_EQ(cache->counters().peak_bytes, frameBytes(5));
}

TEST(PageCache, DataIsAsLongAsTheLoaderSaid) {
  auto cache = makeCache(10, 4, [](PageNumber page, std::span<std::byte> frame) {
    EXPECT_EQ(frame.size(), kTestPageBytes);
    auto loaded = loadNumber(page, frame);
    loaded->decoded_bytes = page * 4;
    return loaded;
  });
  CacheFront front(*cache, 2);
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (PageNumber page = 0; page < 10; ++page) {
      EXPECT_EQ(front.lookup(page)->size(), page * 4);  // none at all is a page, too
      EXPECT_EQ(front.pin(page)->data().size(), page * 4);
    }
  }
}

TEST(PageCache, CountersAddUp) {
  auto cache = makeCache(50, 8);
  CacheFront front(*cache, 1);
  std::mt19937 random(5);
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(front.pin(random() % 50).ok());
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.requests, 1000u);
  EXPECT_EQ(counters.hits + counters.misses, 1000u);
  EXPECT_EQ(counters.front_hits + counters.shared_hits, counters.hits);
  EXPECT_EQ(counters.evictions, counters.misses - 8);
  EXPECT_EQ(distinctPages(counters), 50u);
  EXPECT_EQ(counters.repeated_loads, counters.misses - 50);
  EXPECT_EQ(counters.failed_loads, 0u);
  EXPECT_EQ(counters.bytes_read, counters.misses * kTestStoredBytes);
  EXPECT_EQ(counters.repeated_bytes, counters.repeated_loads * kTestStoredBytes);
  EXPECT_GT(counters.load_ns, 0u);
  EXPECT_EQ(counters.stall_ns, counters.load_ns);  // nobody waited for anyone else
  EXPECT_EQ(counters.peak_bytes, frameBytes(8));
  EXPECT_EQ(counters.budget_bytes, frameBytes(8));
  EXPECT_EQ(counters.decoded_bytes, frameBytes(50));
}

TEST(PageCache, EveryFrameCountFromNoneToAllWorks) {
  // No frame: an error, not a wait for ever
  EXPECT_EQ(PageCache::create({10, kTestPageBytes, 0}, loadNumber).status().code(),
            StatusCode::kBudgetTooSmall);

  auto one = makeCache(10, 1);
  for (PageNumber page = 0; page < 10; ++page) {
    EXPECT_TRUE(holds(CacheFront(*one, 1).lookup(page), page));
  }
  EXPECT_EQ(one->counters().evictions, 9u);

  // More frames than pages are never used, nor counted
  auto all = makeCache(10, 1000);
  EXPECT_EQ(all->frameLimit(), 10u);
  for (PageNumber i = 0; i < 100; ++i) ASSERT_TRUE(CacheFront(*all, 1).pin(i % 10).ok());
  EXPECT_EQ(all->counters().misses, 10u);
  EXPECT_EQ(all->counters().evictions, 0u);
}

TEST(PageCache, PageOutOfRangeIsCorruption) {
  auto cache = makeCache(10, 4);
  CacheFront front(*cache, 4);
  for (const PageNumber page : {10u, 0xfffffffeu, 0xffffffffu}) {
    EXPECT_EQ(front.pin(page).status().code(), StatusCode::kCorruption);
    EXPECT_EQ(front.lookup(page).status().code(), StatusCode::kCorruption);
  }
  EXPECT_EQ(front.pin(10).status().message(), "page 10 does not exist: expected less than 10");
  EXPECT_EQ(cache->counters().requests, 0u);

  auto empty = makeCache(0, 4);
  CacheFront empty_front(*empty, 4);
  EXPECT_EQ(empty_front.pin(0).status().code(), StatusCode::kCorruption);
  empty->setFrameLimit(3);
  EXPECT_EQ(empty->frameLimit(), 0u);
}

TEST(PageCache, ImpossiblePoolFails) {
  const auto cache = PageCache::create({0xffffffffu, std::size_t{1} << 40, 1u << 31}, loadNumber);
  EXPECT_EQ(cache.status().code(), StatusCode::kFailed);
  const auto larger = PageCache::create({1, ~std::size_t{0}, 1}, loadNumber);
  EXPECT_EQ(larger.status().code(), StatusCode::kFailed);
}

TEST(PageCache, MemoryBytesCountsFramesAndTables) {
  const std::size_t some = PageCache::memoryBytes({1000, 4096, 100});
  const std::size_t frame = PageCache::memoryBytes({1000, 4096, 101}) - some;
  EXPECT_GE(frame, PageCache::frameBytes(4096));
  EXPECT_LE(frame, PageCache::frameBytes(4096) + 40);
  EXPECT_EQ(PageCache::memoryBytes({2000, 4096, 100}) - some, 1000u * 16);
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

  std::atomic<int> asking{0}, right{0};
  const auto request = [&] {
    CacheFront front(*cache, 4);
    ++asking;
    if (holds(front.lookup(7), 7)) ++right;
  };
  std::thread first(request), second(request);
  EXPECT_TRUE(Gate::waitFor([&] { return asking == 2 && loads == 1; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // so that the other one waits by now
  gate.open();
  first.join();
  second.join();
  EXPECT_EQ(right, 2);
  EXPECT_EQ(loads, 1);
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.misses, 1u);
  EXPECT_EQ(counters.hits, 1u);
  EXPECT_GT(counters.stall_ns, counters.load_ns);
}

TEST(PageCache, OtherPagesAreServedWhileOneLoads) {
  Gate gate;
  auto cache = makeCache(10, 4, [&](PageNumber page, std::span<std::byte> frame) {
    if (page == 7) gate.waitUntilOpen();
    return loadNumber(page, frame);
  });
  std::thread slow([&] { EXPECT_TRUE(holds(CacheFront(*cache, 1).lookup(7), 7)); });
  EXPECT_TRUE(Gate::waitFor([&] { return cache->counters().misses == 1; }));
  CacheFront front(*cache, 1);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(front.pin(3).ok());
  EXPECT_EQ(cache->counters().shared_hits, 2u);
  gate.open();
  slow.join();
}

TEST(PageCache, FailedLoadReachesAllWaitersAndIsNotCached) {
  Gate gate;
  std::atomic<bool> broken{true};
  const std::string reason = "scene.sft: page 7 at 30015488: checksum 9f0c21aa, expected 41d7b3e0";
  auto cache = makeCache(
      10, 2, [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
        if (!broken || page != 7) return loadNumber(page, frame);
        gate.waitUntilOpen();
        return Status::corruption(reason);
      });

  std::atomic<int> told{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const auto data = CacheFront(*cache, 4).lookup(7);
      told += data.status().code() == StatusCode::kCorruption && data.status().message() == reason;
    });
  }
  EXPECT_TRUE(Gate::waitFor([&] { return cache->counters().misses == 1; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // so that the others wait by now
  gate.open();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(told, 4);
  EXPECT_EQ(cache->counters().failed_loads, 1u);
  EXPECT_EQ(cache->counters().waits, 3u);
  EXPECT_EQ(cache->counters().bytes_read, 0u);
  EXPECT_FALSE(cache->isLoaded(7));

  // It fails again as long as it is broken, and works afterwards; no frame was lost
  CacheFront front(*cache, 1);
  EXPECT_FALSE(front.pin(7).ok());
  broken = false;
  const auto retry = front.pin(7);
  EXPECT_TRUE(holds(retry, 7));
  EXPECT_TRUE(front.pin(8).ok());
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.misses, 4u);
  EXPECT_EQ(counters.failed_loads, 2u);
  EXPECT_EQ(distinctPages(counters), 2u);
  EXPECT_EQ(counters.peak_bytes, frameBytes(2));
}

TEST(PageCache, FailedReloadIsNoDistinctPage) {
  std::atomic<bool> broken{false};
  auto cache = makeCache(
      10, 1, [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
        if (broken) return Status::ioError("broken");
        return loadNumber(page, frame);
      });
  CacheFront front(*cache, 1);
  ASSERT_TRUE(front.lookup(1).ok());
  ASSERT_TRUE(front.lookup(2).ok());
  broken = true;
  EXPECT_FALSE(front.lookup(1).ok());
  EXPECT_EQ(distinctPages(cache->counters()), 2u);
  EXPECT_EQ(cache->counters().repeated_loads, 0u);
}

TEST(PageCache, ThrowingLoaderIsAFailedLoad) {
  int kind = 0;
  auto cache = makeCache(
      10, 1, [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
        if (kind == 0) throw std::runtime_error("out of something");
        if (kind == 1) throw std::bad_alloc();
        if (kind == 2) throw 5;
        return loadNumber(page, frame);
      });
  CacheFront front(*cache, 1);
  for (const char* message :
       {"cannot load page 1: out of something", "out of memory", "cannot load page 1"}) {
    const auto data = front.lookup(1);
    EXPECT_EQ(data.status().code(), StatusCode::kFailed);
    EXPECT_EQ(data.status().message(), message);
    ++kind;
  }
  EXPECT_TRUE(holds(front.lookup(1), 1));
}

TEST(PageCache, MissWaitsWhileEveryFrameIsPinned) {
  auto cache = makeCache(10, 2);
  CacheFront front(*cache, 1);
  PageCache::Pin first = std::move(*front.pin(1));
  PageCache::Pin second = std::move(*front.pin(2));

  // Two threads want one page and a third another; a single frame comes free
  std::atomic<int> right{0};
  std::vector<std::thread> threads;
  for (const PageNumber page : {5u, 5u, 6u}) {
    threads.emplace_back(
        [&cache, &right, page] { right += holds(CacheFront(*cache, 1).pin(page), page); });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(right, 0);
  EXPECT_EQ(cache->counters().misses, 2u);
  first.release();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 3);
  EXPECT_TRUE(holds(second.data(), 2));
}

TEST(PageCache, ResidentPagesAreNeverEvicted) {
  auto cache = makeCache(100, 8);
  ASSERT_TRUE(cache->keepResident(5).ok());
  EXPECT_EQ(cache->counters().prefetches, 5u);
  {
    CacheFront front(*cache, 2);
    for (int repeat = 0; repeat < 3; ++repeat) {
      for (PageNumber page = 0; page < 100; ++page) EXPECT_TRUE(holds(front.lookup(page), page));
    }
    EXPECT_TRUE(holds(front.pin(0), 0));  // by the ordinary way, too
  }
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.misses, 3 * 95u);
  EXPECT_EQ(counters.front_hits, 3 * 5u);
  EXPECT_EQ(distinctPages(counters), 100u);

  // No limit takes them, nor the last frame of the others
  cache->setFrameLimit(1);
  EXPECT_EQ(cache->frameLimit(), 6u);
  EXPECT_TRUE(holds(CacheFront(*cache, 2).lookup(77), 77));
}

TEST(PageCache, ResidentPagesLeaveOneFrame) {
  EXPECT_EQ(makeCache(100, 8)->keepResident(8).code(), StatusCode::kBudgetTooSmall);
  EXPECT_TRUE(makeCache(100, 8)->keepResident(7).ok());
  EXPECT_TRUE(makeCache(8, 8)->keepResident(8).ok());  // there are no others
  EXPECT_TRUE(makeCache(0, 0)->keepResident(0).ok());
}

TEST(PageCache, ResidentPagesThatFailMayBeTriedAgain) {
  bool broken = true;
  auto cache = makeCache(
      10, 8, [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
        if (broken && page == 3) return Status::ioError("page 3");
        return loadNumber(page, frame);
      });
  EXPECT_EQ(cache->keepResident(5).code(), StatusCode::kIoError);
  broken = false;
  EXPECT_TRUE(cache->keepResident(5).ok());
  CacheFront front(*cache, 1);
  for (PageNumber page = 0; page < 10; ++page) EXPECT_TRUE(holds(front.lookup(page), page));
}

}  // namespace
}  // namespace surfeit
