// Large caches hide lifetime races: what finds them is a tiny cache, many threads, pages that know
// their own number, and loads that fail.
//
// SURFEIT_TORTURE_LOOKUPS: how many in all of the second.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"
#include "cache/process_barrier.h"

namespace surfeit {
namespace {

constexpr PageNumber kTorturePages = 2000;

// A loader that sees to it that no page is loaded twice at a time, and fails at random.
class TortureSource {
 public:
  PageCache::Loader loader() {
    return [this](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
      if (loading_[page].fetch_add(1) != 0) ++overlaps_;
      const std::uint64_t load = ++loads_;
      auto result = loadNumber(page, frame);
      loading_[page].fetch_sub(1);
      if (load % 29 != 0) return result;
      ++failures_;
      if (load % 2 == 0) throw std::bad_alloc();
      return Status::ioError("injected, with a text that is too long to fit into a short string");
    };
  }
  std::uint64_t loads() const { return loads_; }
  std::uint64_t failures() const { return failures_; }
  std::uint64_t overlaps() const { return overlaps_; }

 private:
  std::atomic<std::uint64_t> loads_{0}, failures_{0}, overlaps_{0};
  std::vector<std::atomic<int>> loading_ = std::vector<std::atomic<int>>(kTorturePages);
};

struct Torture {
  std::size_t frames;
  unsigned threads;
  std::size_t slots;  // of each thread's front
  bool holds_pin;     // each thread holds a pin of its own beside its front's pages
  int lookups;        // of each thread
};

// Counts what went wrong in one thread.
std::uint64_t tortureThread(PageCache& cache, const Torture& torture, unsigned id) {
  std::mt19937 random(id);
  CacheFront front(cache, torture.slots);
  PageCache::Pin pin;
  PageNumber pinned_page = 0;
  std::uint64_t wrong = 0;
  for (int i = 0; i < torture.lookups; ++i) {
    // Half of the requests go to few pages, so that threads meet
    const PageNumber page = random() % 2 == 0 ? random() % 20 : random() % kTorturePages;
    if (random() % 4 == 0) {
      pin.release();
      auto result = front.pin(page);
      if (result.ok()) {
        pin = std::move(*result);
        pinned_page = page;
      }
    } else if (const auto data = front.lookup(page); data.ok()) {
      if (random() % 8 == 0) std::this_thread::yield();
      wrong += !holds(data, page);
    }
    if (pin) wrong += !holds(pin.data(), pinned_page);
    if (!torture.holds_pin) pin.release();
    if (random() % 64 == 0) front.release();
  }
  return wrong;
}

void runTorture(const Torture& torture) {
  SCOPED_TRACE(testing::Message() << torture.frames << " frames, " << torture.threads
                                  << " threads, " << torture.slots << " slots");
  TortureSource source;
  auto cache = makeCache(kTorturePages, torture.frames, source.loader());
  std::atomic<std::uint64_t> wrong{0};
  std::vector<std::thread> threads;
  for (unsigned id = 0; id < torture.threads; ++id) {
    threads.emplace_back([&, id] { wrong += tortureThread(*cache, torture, id); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(source.overlaps(), 0u);

  const CacheCounters counters = cache->counters();
  EXPECT_EQ(counters.requests, std::uint64_t(torture.lookups) * torture.threads);
  EXPECT_EQ(counters.misses, source.loads());
  EXPECT_EQ(counters.failed_loads, source.failures());
  EXPECT_EQ(counters.bytes_read, (source.loads() - source.failures()) * kTestStoredBytes);
  EXPECT_LE(counters.peak_bytes, frameBytes(torture.frames));
  std::uint64_t loaded = 0;
  for (PageNumber page = 0; page < kTorturePages; ++page) loaded += cache->isLoaded(page);
  EXPECT_EQ(loaded, counters.misses - counters.failed_loads - counters.evictions);

  // No pin is left: every frame can be pinned
  CacheFront front(*cache, 1);
  std::vector<PageCache::Pin> all;
  for (PageNumber page = 0; all.size() < torture.frames; ++page) {
    if (auto pin = front.pin(page); pin.ok()) all.push_back(std::move(*pin));
  }
}

void runAllTortures(int lookups) {
  for (const std::size_t frames : {1, 2, 7, 64, 500}) {
    for (const unsigned threads : {1, 2, 3, 8}) {
      for (const std::size_t slots : {1, 8, 64}) {
        // A thread that holds a pin of its own and waits for a frame would wait for others like it
        runTorture({frames, threads, slots, frames > threads, lookups});
      }
    }
  }
}

TEST(CacheTorture, NoPageIsWrong) { runAllTortures(3000); }

// Threads that are more than the frames wait for each other: they look up a hundredth as often.
TEST(CacheTorture, NoPageIsWrongHoweverOftenItIsLookedUp) {
  const char* const asked = std::getenv("SURFEIT_TORTURE_LOOKUPS");
  double left = asked != nullptr ? std::atof(asked) : 2e5;
  const double share = left / (5 * 5 * 3);
  std::uint64_t all = 0;
  for (const std::size_t frames : {1, 2, 7, 64, 500}) {
    for (const unsigned threads : {1, 2, 8, 16, 64}) {
      for (const std::size_t slots : {1, 8, 64}) {
        const bool is_crowded = threads > frames;
        const int lookups = int(share / threads / (is_crowded ? 100 : 1)) + 1;
        runTorture({frames, threads, slots, frames > threads, lookups});
        all += std::uint64_t(lookups) * threads;
        left -= lookups * double(threads);
      }
    }
  }
  // What the crowded ones have not done
  if (left > 0) {
    const int lookups = int(left / 8) + 1;
    runTorture({64, 8, 8, true, lookups});
    all += std::uint64_t(lookups) * 8;
  }
  std::printf("%.3g look-ups\n", double(all));
}

// Lets this process have no membarrier, as old kernels and some sandboxes do.
void forbidProcessBarrier() {
  sock_filter filter[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_membarrier, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program = {sizeof filter / sizeof filter[0], filter};
  ASSERT_EQ(prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), 0);
  ASSERT_EQ(prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program), 0);
}

TEST(CacheTortureDeathTest, NoPageIsWrongWithoutProcessBarrier) {
  testing::GTEST_FLAG(death_test_style) = "threadsafe";
  EXPECT_EXIT(
      {
        forbidProcessBarrier();
        if (registerProcessBarrier()) std::exit(2);
        runAllTortures(1000);
        std::exit(testing::Test::HasFailure() ? 1 : 0);
      },
      testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace surfeit
