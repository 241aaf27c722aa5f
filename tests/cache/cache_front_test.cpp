#include "cache/cache_front.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "cache/cache_test_pages.h"
#include "cache/reuse_distances.h"

namespace surfeit {
namespace {

TEST(CacheFront, HitsNeedNoSharedRequest) {
  auto cache = makeCache(100, 8);
  CacheFront front(*cache, 4);
  for (int i = 0; i < 1000; ++i) {
    for (PageNumber page = 8; page < 12; ++page) ASSERT_TRUE(holds(front.lookup(page), page));
  }
  CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.front_hits, 3996u);
  EXPECT_EQ(counters.shared_hits, 0u);
  EXPECT_EQ(counters.misses, 4u);

  // Given back, they are asked for again, and found
  front.release();
  for (PageNumber page = 8; page < 12; ++page) ASSERT_TRUE(holds(front.lookup(page), page));
  counters = cache->counters();
  EXPECT_EQ(counters.shared_hits, 4u);
  EXPECT_EQ(counters.misses, 4u);
}

TEST(CacheFront, CountsOutliveIt) {
  auto cache = makeCache(10, 2);
  for (int i = 0; i < 3; ++i) {
    CacheFront front(*cache, 1);
    ASSERT_TRUE(front.lookup(3).ok());
    ASSERT_TRUE(front.lookup(3).ok());
  }
  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.requests, 6u);
  EXPECT_EQ(counters.front_hits, 3u);
  EXPECT_EQ(counters.shared_hits, 2u);
}

TEST(CacheFront, NeverHoldsMoreThanItsSlots) {
  // As many frames as slots: a front that took one more would wait for itself
  for (const std::size_t slots : {0, 1, 2, 3, 8}) {
    auto cache = makeCache(100, std::max<std::size_t>(slots & ~std::size_t{1}, 1));
    CacheFront front(*cache, slots);  // 3 becomes 2
    std::mt19937 random(1);
    for (int i = 0; i < 10000; ++i) {
      const PageNumber page = random() % 100;
      ASSERT_TRUE(holds(front.lookup(page), page));
    }
    EXPECT_EQ(cache->counters().stall_ns,
              cache->counters().load_ns);  // it never waited for a frame
  }
}

TEST(CacheFront, PagesInSlotsAreNotEvicted) {
  auto cache = makeCache(100, 5);
  CacheFront front(*cache, 4), other(*cache, 1);
  std::vector<std::span<const std::byte>> data;
  for (PageNumber page = 0; page < 4; ++page) data.push_back(*front.lookup(page));
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (PageNumber page = 4; page < 100; ++page) ASSERT_TRUE(holds(other.lookup(page), page));
  }
  for (PageNumber page = 0; page < 4; ++page) EXPECT_TRUE(holds(data[page], page));
  EXPECT_EQ(cache->counters().misses, 4 + 3 * 96u);
}

TEST(CacheFront, LetsGoOfAllBeforeItWaits) {
  // The front holds both frames, and the page it wants next falls into one slot: but a pin that is
  // held, too, leaves it no other frame than that of its other slot
  auto cache = makeCache(10, 2);
  CacheFront front(*cache, 2);
  ASSERT_TRUE(front.lookup(0).ok());
  const auto pin = front.pin(0);
  ASSERT_TRUE(front.lookup(1).ok());
  EXPECT_TRUE(holds(front.lookup(2), 2));
  EXPECT_TRUE(holds(pin, 0));
  EXPECT_FALSE(cache->isLoaded(1));
}

TEST(CacheFront, FailedLookupLeavesTheFrontUsable) {
  bool broken = true;
  auto cache = makeCache(
      10, 2, [&](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
        if (broken && page == 3) return Status::ioError("page 3");
        return loadNumber(page, frame);
      });
  CacheFront front(*cache, 2);
  ASSERT_TRUE(front.lookup(1).ok());
  EXPECT_EQ(front.lookup(3).status().code(), StatusCode::kIoError);
  EXPECT_EQ(front.lookup(3).status().code(), StatusCode::kIoError);
  broken = false;
  EXPECT_TRUE(holds(front.lookup(3), 3));
  EXPECT_TRUE(holds(front.lookup(1), 1));
}

TEST(CacheFront, PrefetchesAreCountedApart) {
  auto cache = makeCache(10, 4);
  CacheFront prefetch(*cache, 1, CacheFront::Role::kPrefetch), front(*cache, 1);
  for (const PageNumber page : {1u, 1u, 2u, 1u}) ASSERT_TRUE(prefetch.lookup(page).ok());
  CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.requests, 0u);
  EXPECT_EQ(counters.prefetches, 2u);
  EXPECT_EQ(counters.stall_ns, 0u);
  EXPECT_GT(counters.load_ns, 0u);
  ASSERT_TRUE(front.lookup(2).ok());
  counters = cache->counters();
  EXPECT_EQ(counters.shared_hits, 1u);
  EXPECT_EQ(counters.misses, 0u);
}

TEST(CacheFront, ReuseDistancesSeeWhatFrontsDoNotAnswer) {
  ReuseDistances distances(10, 10);
  auto cache = std::move(*PageCache::create({10, 64, 4, &distances}, loadNumber));
  CacheFront front(*cache, 1), prefetch(*cache, 1, CacheFront::Role::kPrefetch);
  for (const PageNumber page : {1u, 1u, 2u, 2u, 1u}) ASSERT_TRUE(front.lookup(page).ok());
  ASSERT_TRUE(front.pin(3).ok());
  ASSERT_TRUE(prefetch.lookup(4).ok());
  EXPECT_FALSE(front.lookup(10).ok());
  EXPECT_EQ(distances.touches(), 4u);
}

// As readers of an octree use their two caches: surfels are looked up for a node, whose page must
// stay meanwhile.
TEST(CacheFront, TwoCachesOfOneFrameEachServeEightThreads) {
  constexpr PageNumber kPages = 20;
  for (const std::size_t frames : {1, 2}) {
    auto nodes = makeCache(kPages, frames), surfels = makeCache(kPages, frames);
    std::atomic<int> wrong{0};
    std::vector<std::thread> threads;
    for (unsigned id = 0; id < 8; ++id) {
      threads.emplace_back([&, id] {
        CacheFront node_front(*nodes, 4), surfel_front(*surfels, 4);
        node_front.yieldTo(surfel_front);
        std::mt19937 random(id);
        for (int i = 0; i < 300; ++i) {
          const PageNumber node = random() % kPages;
          const auto data = node_front.lookup(node);
          for (int k = 0; k < 3; ++k) {
            const PageNumber surfel = random() % kPages;
            wrong += !holds(surfel_front.lookup(surfel), surfel) || !holds(data, node);
          }
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(nodes->counters().requests, 8 * 300u);
    EXPECT_EQ(surfels->counters().requests, 8 * 900u);
    EXPECT_LE(nodes->counters().peak_bytes, frameBytes(frames));
  }
}

}  // namespace
}  // namespace surfeit
