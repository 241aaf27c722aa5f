// Every allocation of the cache fails in turn. A program of its own, as it replaces operator new.
#include <gtest/gtest.h>

#include <new>
#include <optional>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"
#include "failing_allocations.h"

namespace surfeit {
namespace {

constexpr PageNumber kPages = 40;

// The loader allocates as real ones do, and fails with a long text for one page.
Result<PageCache::Loaded> loadWithAllocation(PageNumber page, std::span<std::byte> frame) {
  const std::vector<std::byte> scratch(100);
  if (page == 30) return Status::ioError(std::string(100, 'x'));
  return loadNumber(page, frame);
}

// All that allocates, as one run. What it made before memory ran out stays in the arguments. False
// when a Status told of it.
bool useCache(std::unique_ptr<PageCache>& cache, std::optional<CacheFront>& front) {
  auto created = PageCache::create({kPages, kTestPageBytes, 8}, loadWithAllocation);
  if (!created.ok()) return false;
  cache = std::move(*created);
  if (!cache->keepResident(3).ok()) return false;
  front.emplace(*cache, 4);
  bool all_ok = true;
  for (PageNumber page = 0; page < kPages; ++page) {
    const auto data = front->lookup(page);
    if (page != 30 && !data.ok()) {
      EXPECT_EQ(data.status().message(), "out of memory");
      all_ok = false;
    }
    if (page == 30 && data.status().code() != StatusCode::kIoError) all_ok = false;
  }
  EXPECT_FALSE(front->pin(kPages).ok());
  cache->setFrameLimit(20);
  for (PageNumber page = 0; page < 20; ++page) all_ok = front->pin(page).ok() && all_ok;
  cache->setFrameLimit(5);
  CacheFront second(*cache, 64);
  return second.lookup(1).ok() && all_ok;
}

// As if nothing had happened.
void expectUsable(PageCache& cache) {
  CacheFront front(cache, 4);
  for (const std::size_t limit : {30, 4}) {
    cache.setFrameLimit(limit);
    for (PageNumber page = 0; page < kPages; ++page) {
      EXPECT_TRUE(page == 30 || holds(front.lookup(page), page));
    }
  }
  const CacheCounters counters = cache.counters();
  std::uint64_t loaded = 0;
  for (PageNumber page = 0; page < kPages; ++page) loaded += cache.isLoaded(page);
  EXPECT_EQ(loaded,
            counters.misses + counters.prefetches - counters.failed_loads - counters.evictions);
}

TEST(CacheAllocation, EveryFailureIsCleanAndLeavesTheCacheUsable) {
  for (const bool for_ever : {false, true}) {
    long failures = 0;
    for (bool any_failed = true; any_failed; ++failures) {
      ASSERT_LT(failures, 1000);
      const long live_before = live_allocations;
      {
        std::unique_ptr<PageCache> cache;
        std::optional<CacheFront> front;
        bool is_ok = false;
        {
          const FailingAllocations failing(failures, for_ever);
          try {
            is_ok = useCache(cache, front);
          } catch (const std::bad_alloc&) {
          }
          any_failed = failing.anyFailed();
        }
        EXPECT_NE(is_ok, any_failed) << "allocation " << failures;
        if (front.has_value()) front->release();
        if (cache != nullptr) expectUsable(*cache);
      }
      EXPECT_EQ(live_allocations, live_before) << "allocation " << failures;
    }
    EXPECT_GT(failures, 50);
  }
}

}  // namespace
}  // namespace surfeit
