// Pages that know their own number, for the tests of caches.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <thread>
#include <utility>

#include "cache/page_cache.h"

namespace surfeit {

constexpr std::size_t kTestPageBytes = 256;
constexpr std::uint32_t kTestStoredBytes = 100;  // what the loader says it read for a page

// Fills the whole frame with its page number, so that a frame changed too early is seen.
inline Result<PageCache::Loaded> loadNumber(PageNumber page, std::span<std::byte> frame) {
  for (std::size_t at = 0; at < frame.size(); at += sizeof page) {
    std::memcpy(frame.data() + at, &page, sizeof page);
  }
  return PageCache::Loaded{kTestStoredBytes, static_cast<std::uint32_t>(frame.size())};
}

// Whether a whole page carries its number.
inline bool holds(std::span<const std::byte> data, PageNumber page) {
  for (std::size_t at = 0; at < data.size(); at += sizeof page) {
    if (std::memcmp(data.data() + at, &page, sizeof page) != 0) return false;
  }
  return !data.empty();
}
inline bool holds(const Result<std::span<const std::byte>>& data, PageNumber page) {
  return data.ok() && holds(*data, page);
}
inline bool holds(const Result<PageCache::Pin>& pin, PageNumber page) {
  return pin.ok() && holds(pin->data(), page);
}

inline std::unique_ptr<PageCache> makeCache(PageNumber pages, std::size_t frames,
                                            PageCache::Loader loader = loadNumber,
                                            std::size_t page_bytes = kTestPageBytes) {
  auto cache = PageCache::create({pages, page_bytes, frames}, std::move(loader));
  EXPECT_TRUE(cache.ok()) << cache.status().message();
  return std::move(*cache);
}

// Bytes of `frames` frames of test pages.
inline std::uint64_t frameBytes(std::size_t frames) {
  return frames * PageCache::frameBytes(kTestPageBytes);
}

// Pages ever loaded, or being loaded.
inline std::uint64_t distinctPages(const CacheCounters& counters) {
  return counters.misses + counters.prefetches - counters.repeated_loads - counters.failed_loads;
}

// A gate that a loader waits at. Closed until open() is called; gives up after ten seconds, so that
// a broken cache fails the test instead of hanging it.
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

}  // namespace surfeit
