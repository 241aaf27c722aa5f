// The number of frames changes while the cache is used, and memory follows it.
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <algorithm>
#include <random>
#include <vector>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"

namespace surfeit {
namespace {

constexpr std::size_t kSystemPage = 4096;

// Resident bytes of an empty cache's frames. Finds them by the first, which a new cache uses first.
class ResidentBytes {
 public:
  explicit ResidentBytes(PageCache& cache, std::size_t page_bytes, std::size_t frames) {
    const auto pin = CacheFront(cache, 1).pin(0);
    begin_ = const_cast<std::byte*>(pin->data().data());
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(begin_) % kSystemPage, 0u);
    pages_.resize(frames * PageCache::frameBytes(page_bytes) / kSystemPage + 1);
  }
  std::size_t count() {
    EXPECT_EQ(mincore(begin_, pages_.size() * kSystemPage, pages_.data()), 0);
    return kSystemPage * std::size_t(std::count_if(pages_.begin(), pages_.end(),
                                                   [](auto page) { return page & 1; }));
  }

 private:
  std::byte* begin_;
  std::vector<unsigned char> pages_;
};

TEST(FrameLimit, MemoryFollowsIt) {
  for (const std::size_t page_bytes : {1000, 4096, 16384, 50000}) {
    constexpr std::size_t kFrames = 512;
    auto cache = makeCache(2 * kFrames, kFrames, loadNumber, page_bytes);
    const std::size_t stride = PageCache::frameBytes(page_bytes);
    ResidentBytes resident(*cache, page_bytes, 2 * kFrames);
    CacheFront front(*cache, 1);
    for (PageNumber page = 0; page < kFrames; ++page) ASSERT_TRUE(front.pin(page).ok());
    EXPECT_GE(resident.count(), kFrames * stride);

    for (const std::size_t limit : {500, 100, 99, 3, 1}) {
      cache->setFrameLimit(limit);
      EXPECT_EQ(cache->frameLimit(), limit);
      EXPECT_LE(resident.count(), limit * stride + kSystemPage) << limit << " frames";
      // As many pages are still there, wherever they were before; at first, those used last
      std::size_t loaded = 0;
      for (PageNumber page = 0; page < kFrames; ++page) {
        ASSERT_TRUE(limit < 500 || cache->isLoaded(page) == (page >= kFrames - limit));
        loaded += cache->isLoaded(page);
        ASSERT_TRUE(!cache->isLoaded(page) || holds(front.pin(page), page));
      }
      EXPECT_EQ(loaded, limit);
    }
    EXPECT_EQ(cache->counters().misses, kFrames);
    EXPECT_EQ(cache->counters().evictions, kFrames - 1);

    // And up again, beyond what it was at first, but not beyond one frame per page
    cache->setFrameLimit(5 * kFrames);
    EXPECT_EQ(cache->frameLimit(), 2 * kFrames);
    EXPECT_LE(resident.count(), stride + kSystemPage);
    for (int repeat = 0; repeat < 2; ++repeat) {
      for (PageNumber page = 0; page < 2 * kFrames; ++page)
        ASSERT_TRUE(holds(front.pin(page), page));
    }
    EXPECT_EQ(cache->counters().misses, 3 * kFrames - 1);
    EXPECT_EQ(cache->counters().peak_bytes, 2 * kFrames * stride);
    cache->setFrameLimit(0);
    EXPECT_EQ(cache->frameLimit(), 1u);
    EXPECT_LE(resident.count(), stride + kSystemPage);
  }
}

TEST(FrameLimit, MostFramesBoundsIt) {
  PageCache::Options options{1000, 64, 10};
  options.most_frames = 50;
  auto cache = std::move(*PageCache::create(options, loadNumber));
  cache->setFrameLimit(100);
  EXPECT_EQ(cache->frameLimit(), 50u);
  CacheFront front(*cache, 1);
  for (PageNumber page = 0; page < 1000; ++page) ASSERT_TRUE(holds(front.lookup(page), page));
  EXPECT_EQ(cache->counters().peak_bytes, 50 * PageCache::frameBytes(64));
}

// What is held beyond a new limit stays as it is, and goes when it is let go of, be it by a pin or
// by a front, though nobody asks for a page then.
TEST(FrameLimit, HeldPagesGoWhenTheyAreLetGoOf) {
  constexpr std::size_t kPageBytes = 8192, kFrames = 100;
  auto cache = makeCache(1000, kFrames, loadNumber, kPageBytes);
  const std::size_t stride = PageCache::frameBytes(kPageBytes);
  ResidentBytes resident(*cache, kPageBytes, kFrames);
  CacheFront front(*cache, 16), other(*cache, 1);
  std::vector<std::pair<PageNumber, PageCache::Pin>> pins;
  for (PageNumber page = 0; page < 80; ++page) ASSERT_TRUE(other.pin(page).ok());
  for (PageNumber page = 80; page < 90; ++page) {
    pins.emplace_back(page, std::move(*other.pin(page)));
  }
  std::vector<std::span<const std::byte>> slots;
  for (PageNumber page = 90; page < 100; ++page) slots.push_back(*front.lookup(page));

  cache->setFrameLimit(4);
  EXPECT_LE(resident.count(), (20 + 4) * stride + 3 * kSystemPage);
  for (const auto& [page, pin] : pins) EXPECT_TRUE(holds(pin.data(), page));
  for (PageNumber page = 90; page < 100; ++page) EXPECT_TRUE(holds(slots[page - 90], page));
  while (!pins.empty()) pins.erase(pins.begin() + std::ptrdiff_t(pins.size() / 2));
  EXPECT_LE(resident.count(), (10 + 4) * stride + 3 * kSystemPage);
  for (PageNumber page = 90; page < 100; ++page) EXPECT_TRUE(holds(front.lookup(page), page));
  front.release();
  EXPECT_LE(resident.count(), 4 * stride + kSystemPage);

  // Four pages are left, and four can be held
  std::size_t left = 0;
  for (PageNumber page = 0; page < 1000; ++page) left += cache->isLoaded(page);
  EXPECT_EQ(left, 4u);
  for (PageNumber page = 0; page < 4; ++page) pins.emplace_back(page, std::move(*other.pin(page)));
  EXPECT_EQ(cache->counters().peak_bytes, kFrames * stride);
}

TEST(FrameLimit, RaisedItWakesThoseThatWait) {
  auto cache = makeCache(10, 1);
  CacheFront front(*cache, 1);
  const auto pin = front.pin(1);
  std::thread waiting([&] { EXPECT_TRUE(holds(CacheFront(*cache, 1).lookup(2), 2)); });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(cache->counters().misses, 1u);
  cache->setFrameLimit(2);
  waiting.join();
}

// A page that is being loaded when its frame falls beyond the limit.
TEST(FrameLimit, FallsWhilePagesLoad) {
  for (const bool fails : {false, true}) {
    Gate gate;
    std::atomic<int> loading{0};
    constexpr std::size_t kPageBytes = 8192;
    auto cache = makeCache(
        100, 8,
        [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
          auto loaded = loadNumber(page, frame);
          if (page == 0) return loaded;
          ++loading;
          gate.waitUntilOpen();
          if (fails) return Status::ioError("injected");
          return loaded;
        },
        kPageBytes);
    ResidentBytes resident(*cache, kPageBytes, 8);
    std::vector<std::thread> threads;
    for (PageNumber page = 1; page < 8; ++page) {
      threads.emplace_back(
          [&, page] { EXPECT_EQ(holds(CacheFront(*cache, 1).lookup(page), page), !fails); });
    }
    EXPECT_TRUE(Gate::waitFor([&] { return loading == 7; }));
    cache->setFrameLimit(2);
    gate.open();
    for (std::thread& thread : threads) thread.join();
    EXPECT_LE(resident.count(), 2 * PageCache::frameBytes(kPageBytes) + kSystemPage);
    std::size_t left = 0;
    for (PageNumber page = 0; page < 100; ++page) left += cache->isLoaded(page);
    EXPECT_LE(left, 2u);
  }
}

// Up and down while eight threads read, with few frames and with many.
TEST(FrameLimit, ChangesWhileThreadsRead) {
  for (const std::size_t most : {10, 300}) {
    constexpr PageNumber kPages = 500;
    constexpr std::size_t kPageBytes = 8192;
    auto cache = makeCache(kPages, most, loadNumber, kPageBytes);
    ResidentBytes resident(*cache, kPageBytes, most);
    std::atomic<std::uint64_t> wrong{0};
    std::atomic<int> running{8};
    std::vector<std::thread> threads;
    for (unsigned id = 0; id < 8; ++id) {
      threads.emplace_back([&, id] {
        CacheFront front(*cache, id % 2 == 0 ? 1 : 8);
        std::mt19937 random(id);
        for (int i = 0; i < 4000; ++i) {
          const PageNumber page = random() % 2 == 0 ? random() % 20 : random() % kPages;
          if (random() % 4 == 0) {
            wrong += !holds(front.pin(page), page);
          } else {
            wrong += !holds(front.lookup(page), page);
          }
        }
        front.release();
        --running;
      });
    }
    std::mt19937 random(99);
    while (running > 0) {
      cache->setFrameLimit(random() % 2 == 0 ? 1 : 1 + random() % most);
      std::this_thread::yield();
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0u);
    const CacheCounters counters = cache->counters();
    EXPECT_EQ(counters.requests, 8 * 4000 + 1u);
    EXPECT_LE(counters.peak_bytes, most * PageCache::frameBytes(kPageBytes));

    std::size_t left = 0;
    for (PageNumber page = 0; page < kPages; ++page) left += cache->isLoaded(page);
    EXPECT_LE(left, cache->frameLimit());
    EXPECT_EQ(left, counters.misses - counters.evictions);
    EXPECT_LE(resident.count(),
              cache->frameLimit() * PageCache::frameBytes(kPageBytes) + kSystemPage);
    cache->setFrameLimit(1);
    EXPECT_LE(resident.count(), PageCache::frameBytes(kPageBytes) + kSystemPage);
  }
}

// The promise of a budget: what one thread loaded and another replaced takes no more than the
// frames.
TEST(FrameLimit, ResidentBytesEqualTheBudgetWhoeverReplaces) {
  constexpr std::size_t kPageBytes = 16384, kFrames = (64 << 20) / kPageBytes;
  auto cache = makeCache(3 * kFrames, kFrames, loadNumber, kPageBytes);
  ResidentBytes resident(*cache, kPageBytes, 3 * kFrames);
  for (int part = 0; part < 3; ++part) {
    std::thread([&] {
      CacheFront front(*cache, 64);
      for (PageNumber i = 0; i < kFrames; ++i) {
        ASSERT_TRUE(front.lookup(PageNumber(part * kFrames + i)).ok());
      }
    }).join();
    EXPECT_GE(resident.count(), std::size_t{64} << 20);
    EXPECT_LE(resident.count(), kFrames * PageCache::frameBytes(kPageBytes) + kSystemPage);
    EXPECT_LE(double(resident.count()), 1.005 * double(std::size_t{64} << 20));
  }
  EXPECT_LE(double(PageCache::memoryBytes({3 * kFrames, kPageBytes, kFrames})),
            1.02 * double(std::size_t{64} << 20));
}

}  // namespace
}  // namespace surfeit
