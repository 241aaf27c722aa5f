// The caches that cache_bench sets side by side, behind one interface. All hold pages of 16 KiB.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/page_number.h"

namespace surfeit {

constexpr std::size_t kBenchPageBytes = 16 << 10;

// Where pages come from: a copy, no file. Safe from any thread.
class PageSource {
 public:
  PageSource() : bytes_(kBytes, std::byte{1}) {}

  // A page starts with a number that tells which one it is.
  static std::uint64_t tagOf(PageNumber page) { return (page + 1) * 0x9e3779b97f4a7c15u; }

  void load(PageNumber page, std::byte* to) {
    std::memcpy(to, bytes_.data() + page * kBenchPageBytes % kBytes, kBenchPageBytes);
    const std::uint64_t tag = tagOf(page);
    std::memcpy(to, &tag, sizeof tag);
    loads_.fetch_add(1, std::memory_order_relaxed);
  }
  std::uint64_t loads() const { return loads_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kBytes = std::size_t{256} << 20;
  std::vector<std::byte> bytes_;
  std::atomic<std::uint64_t> loads_{0};
};

// Whether that is the page.
inline bool holdsPage(const void* data, PageNumber page) {
  std::uint64_t tag = 0;
  std::memcpy(&tag, data, sizeof tag);
  return tag == PageSource::tagOf(page);
}

// A cache as one thread uses it. A look-up acquires the page, compares its tag, and lets go of it
// (or, where the design has it, keeps it for the next). One thread at a time.
class CacheUser {
 public:
  virtual ~CacheUser() = default;
  // Looks all pages up, and returns how many were not what they should be.
  virtual std::uint64_t replay(std::span<const PageNumber> pages) = 0;
};

class CacheDesign {
 public:
  virtual ~CacheDesign() = default;
  virtual std::unique_ptr<CacheUser> makeUser() = 0;
};

// A user whose look-ups are a function of type bool(PageNumber): whether the page was right.
template <typename Lookup>
class LookupUser : public CacheUser {
 public:
  explicit LookupUser(Lookup lookup) : lookup_(std::move(lookup)) {}
  std::uint64_t replay(std::span<const PageNumber> pages) override {
    std::uint64_t wrong = 0;
    for (const PageNumber page : pages) wrong += lookup_(page) ? 0 : 1;
    return wrong;
  }

 private:
  Lookup lookup_;
};
template <typename Lookup>
std::unique_ptr<CacheUser> makeLookupUser(Lookup lookup) {
  return std::make_unique<LookupUser<Lookup>>(std::move(lookup));
}

struct NamedDesign {
  std::string name;
  bool is_peer = false;  // someone else's
  std::function<std::unique_ptr<CacheDesign>(PageNumber page_count, std::size_t frames,
                                             PageSource& source)>
      make;
};

// This library's cache, through fronts and without; and the baseline: a list in LRU order and a
// hash table behind one mutex.
std::vector<NamedDesign> ownDesigns();

// RocksDB's caches, or none when it was not there to build with.
std::vector<NamedDesign> rocksDbDesigns();

}  // namespace surfeit
