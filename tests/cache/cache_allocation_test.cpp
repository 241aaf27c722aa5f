// Every allocation of the cache fails in turn. A program of its own, as it replaces operator new.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <optional>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"

namespace {

std::atomic<long> live_allocations{0};
std::atomic<long> allocations_until_failure{-1};  // negative: none fails
std::atomic<bool> fails_for_ever{false}, has_failed{false};

void* allocate(std::size_t bytes, std::size_t alignment) {
  if (allocations_until_failure >= 0 && allocations_until_failure.fetch_sub(1) == 0) {
    if (fails_for_ever) allocations_until_failure = 0;
    has_failed = true;
    throw std::bad_alloc();
  }
  void* memory = std::aligned_alloc(alignment, (bytes + alignment) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  ++live_allocations;
  return memory;
}

void release(void* memory) {
  if (memory == nullptr) return;
  --live_allocations;
  std::free(memory);
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes, 16); }
void* operator new[](std::size_t bytes) { return allocate(bytes, 16); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return allocate(bytes, std::size_t(alignment));
}
void* operator new[](std::size_t bytes, std::align_val_t alignment) {
  return allocate(bytes, std::size_t(alignment));
}
void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace surfeit {
namespace {

// Allocations fail as long as this lives: the one after `count` others, or all from there on.
class FailingAllocations {
 public:
  FailingAllocations(long count, bool for_ever) {
    fails_for_ever = for_ever;
    has_failed = false;
    allocations_until_failure = count;
  }
  ~FailingAllocations() { allocations_until_failure = -1; }
  bool anyFailed() const { return has_failed; }
};

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
