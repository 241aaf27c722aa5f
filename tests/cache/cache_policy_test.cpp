// Which pages stay: as a naive model has it, and nearly as in a true LRU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <list>
#include <random>
#include <string>
#include <vector>

#include "cache/cache_front.h"
#include "cache/cache_test_pages.h"

namespace surfeit {
namespace {

// The reference: a plain LRU of page numbers.
class TrueLru {
 public:
  TrueLru(PageNumber pages, std::size_t frames) : at_(pages, order_.end()), frames_(frames) {}

  // Whether it was a hit.
  bool request(PageNumber page) {
    const bool is_hit = at_[page] != order_.end();
    if (is_hit) {
      order_.splice(order_.end(), order_, at_[page]);
    } else {
      if (order_.size() == frames_) {
        at_[order_.front()] = order_.end();
        order_.pop_front();
      }
      at_[page] = order_.insert(order_.end(), page);
    }
    return is_hit;
  }

 private:
  std::list<PageNumber> order_;  // least recent first
  std::vector<std::list<PageNumber>::iterator> at_;
  std::size_t frames_;
};

struct Trace {
  std::string name;
  PageNumber pages = 0;
  std::vector<PageNumber> requests;
};

std::uint64_t distinctPages(const Trace& trace) {
  std::vector<bool> is_requested(trace.pages);
  for (const PageNumber page : trace.requests) is_requested[page] = true;
  return std::uint64_t(std::count(is_requested.begin(), is_requested.end(), true));
}

Trace zipf(PageNumber pages, std::size_t count) {
  Trace trace{"zipf of " + std::to_string(pages), pages, {}};
  std::vector<double> sums(pages);
  double sum = 0;
  for (PageNumber rank = 0; rank < pages; ++rank) sums[rank] = sum += std::pow(rank + 1.0, -0.99);
  std::mt19937 random(pages);
  std::uniform_real_distribution<double> uniform(0, sum);
  for (std::size_t i = 0; i < count; ++i) {
    const auto rank = std::upper_bound(sums.begin(), sums.end() - 1, uniform(random));
    trace.requests.push_back(PageNumber(rank - sums.begin()));
  }
  return trace;
}

Trace uniform(PageNumber pages, std::size_t count) {
  Trace trace{"uniform of " + std::to_string(pages), pages, {}};
  std::mt19937 random(pages);
  for (std::size_t i = 0; i < count; ++i) trace.requests.push_back(random() % pages);
  return trace;
}

Trace loop(PageNumber pages, std::size_t count) {
  Trace trace{"loop of " + std::to_string(pages), pages, {}};
  for (std::size_t i = 0; i < count; ++i) trace.requests.push_back(PageNumber(i % pages));
  return trace;
}

// A window of pages that moves on by one now and then.
Trace window(PageNumber width, std::size_t count) {
  const PageNumber pages = 4 * width + 7;
  Trace trace{"window of " + std::to_string(width), pages, {}};
  std::mt19937 random(width);
  for (std::size_t i = 0; i < count; ++i) {
    trace.requests.push_back(PageNumber((i / 10 + random() % width) % pages));
  }
  return trace;
}

// The same random walk again and again: what is used but once in a walk comes back after all else.
Trace repeated(const Trace& trace) {
  Trace result{trace.name + ", repeated", trace.pages, {}};
  const std::size_t period = trace.requests.size() / 10;
  for (std::size_t i = 0; i < trace.requests.size(); ++i) {
    result.requests.push_back(trace.requests[i % period]);
  }
  return result;
}

TEST(CachePolicy, MissesAreThoseOfATrueLruWithinOnePercent) {
  constexpr std::size_t kRequests = 300'000;
  double worst = 0;
  std::string worst_name = "none";
  for (const std::size_t frames : {1, 2, 7, 64, 500, 5000}) {
    // Caches that hold much less, a good part, and nearly all of what is used
    std::vector<Trace> traces;
    for (const double excess : {1.02, 1.5, 10.0}) {
      const auto pages = PageNumber(std::ceil(double(frames) * excess)) + 1;
      for (const auto make : {zipf, uniform, loop, window}) {
        traces.push_back(make(pages, kRequests));
      }
      traces.push_back(repeated(zipf(pages, kRequests)));
    }
    for (const Trace& trace : traces) {
      auto cache = makeCache(trace.pages, frames, loadNumber, sizeof(PageNumber));
      CacheFront front(*cache, 1);
      TrueLru lru(trace.pages, frames);
      std::uint64_t lru_misses = 0;
      for (const PageNumber page : trace.requests) {
        ASSERT_TRUE(holds(front.pin(page), page));
        lru_misses += lru.request(page) ? 0 : 1;
      }
      const CacheCounters counters = cache->counters();
      EXPECT_EQ(counters.requests, kRequests);
      EXPECT_EQ(counters.evictions,
                counters.misses - std::min<std::size_t>(counters.misses, frames));
      EXPECT_EQ(distinctPages(counters), distinctPages(trace));

      const double difference = double(counters.misses) - double(lru_misses);
      EXPECT_LE(difference, 0.01 * double(lru_misses) + 3)
          << trace.name << ", " << frames << " frames: " << counters.misses << " misses, LRU "
          << lru_misses;
      const double relative = difference / double(lru_misses);
      if (relative > worst) {
        worst = relative;
        worst_name = trace.name + ", " + std::to_string(frames) + " frames";
      }
    }
  }
  RecordProperty("worst", worst_name + ": " + std::to_string(worst));
  std::printf("most misses above a true LRU: %.3f %% (%s)\n", 100 * worst, worst_name.c_str());
}

// Epochs end after a 2048th of the frames' misses at the latest, so that the page that goes was let
// go of, counted in misses, less than that after any other that nobody holds.
TEST(CachePolicy, ThePageThatGoesWasLetGoOfFirst) {
  struct Size {
    std::size_t frames;
    PageNumber pages;
    int requests;
  };
  for (const Size& size :
       {Size{1, 5, 2000}, Size{7, 30, 5000}, Size{60, 200, 20000}, Size{5000, 6500, 40000}}) {
    const std::size_t epoch = std::max<std::size_t>(size.frames / 2048, 1);
    auto cache = makeCache(size.pages, size.frames, loadNumber, sizeof(PageNumber));
    CacheFront front(*cache, 1);
    std::mt19937 random(unsigned(size.frames));
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<std::size_t> let_go(size.pages, 0);
    std::vector<bool> is_loaded(size.pages, false), is_pinned(size.pages, false);
    std::vector<std::pair<PageNumber, PageCache::Pin>> pins;
    const std::size_t most_pins = std::min<std::size_t>(size.frames - 1, 5);
    std::size_t misses = 0;
    for (int i = 0; i < size.requests; ++i) {
      // Squaring favours low pages, so that hits and misses mix
      const double at = unit(random);
      const auto page = PageNumber(at * at * size.pages);
      auto pin = front.pin(page);
      ASSERT_TRUE(holds(pin, page));
      if (!is_loaded[page]) {
        ++misses;
        is_loaded[page] = true;
        PageNumber gone = size.pages;
        std::size_t first = ~std::size_t{0};
        for (PageNumber p = 0; p < size.pages; ++p) {
          if (!is_loaded[p]) continue;
          if (!cache->isLoaded(p)) {
            ASSERT_EQ(gone, size.pages) << "two pages went for one";
            gone = p;
          } else if (!is_pinned[p] && p != page) {
            first = std::min(first, let_go[p]);
          }
        }
        ASSERT_EQ(gone == size.pages, misses <= size.frames);
        if (gone != size.pages) {
          is_loaded[gone] = false;
          ASSERT_FALSE(is_pinned[gone]);
          ASSERT_TRUE(first == ~std::size_t{0} || let_go[gone] < first + epoch) << "request " << i;
        }
      }
      ASSERT_EQ(cache->counters().misses, misses);

      // Keep some, each for a while
      if (!is_pinned[page] && random() % 16 == 0 && most_pins > 0) {
        if (pins.size() == most_pins) {
          auto& oldest = pins.front();
          let_go[oldest.first] = misses;
          is_pinned[oldest.first] = false;
          pins.erase(pins.begin());
        }
        is_pinned[page] = true;
        pins.emplace_back(page, std::move(*pin));
      } else if (!is_pinned[page]) {
        let_go[page] = misses;
      }
    }
  }
}

// After a sweep over everything the pages in use are soon back.
TEST(CachePolicy, ASweepCostsNoMoreThanTheHotPagesOnce) {
  auto cache = makeCache(5000, 200);
  CacheFront front(*cache, 1);
  const auto useHotPages = [&] {
    const std::uint64_t before = cache->counters().misses;
    for (PageNumber i = 0; i < 1000; ++i) EXPECT_TRUE(front.pin(i % 100).ok());
    return cache->counters().misses - before;
  };
  EXPECT_EQ(useHotPages(), 100u);
  EXPECT_EQ(useHotPages(), 0u);
  for (PageNumber page = 0; page < 5000; ++page) EXPECT_TRUE(front.pin(page).ok());
  EXPECT_EQ(useHotPages(), 100u);
  EXPECT_EQ(useHotPages(), 0u);
}

}  // namespace
}  // namespace surfeit
