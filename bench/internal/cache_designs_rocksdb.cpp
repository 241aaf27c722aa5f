// RocksDB's caches: the sharded LRU, and HyperClockCache, its default since version 9.
#include <rocksdb/cache.h>

#include <array>
#include <cstdlib>
#include <cstring>

#include "bench/internal/cache_designs.h"

namespace surfeit {
namespace {

using rocksdb::Cache;

class RocksDbCache : public CacheDesign {
 public:
  RocksDbCache(std::shared_ptr<Cache> cache, PageSource& source)
      : cache_(std::move(cache)), source_(source) {}

  std::unique_ptr<CacheUser> makeUser() override {
    return makeLookupUser([this](PageNumber page) { return lookup(page); });
  }

 private:
  bool lookup(PageNumber page) {
    // HyperClockCache takes keys of 16 bytes alone
    std::array<std::uint64_t, 2> key_bytes = {page, 0};
    const rocksdb::Slice key(reinterpret_cast<const char*>(key_bytes.data()), sizeof key_bytes);
    Cache::Handle* handle = cache_->Lookup(key);
    if (handle == nullptr) {
      void* data = std::malloc(kBenchPageBytes);
      if (data == nullptr) return false;
      source_.load(page, static_cast<std::byte*>(data));
      const auto release = [](const rocksdb::Slice&, void* value) { std::free(value); };
      if (!cache_->Insert(key, data, kBenchPageBytes, release, &handle).ok()) return false;
    }
    const bool is_right = holdsPage(cache_->Value(handle), page);
    cache_->Release(handle);
    return is_right;
  }

  std::shared_ptr<Cache> cache_;
  PageSource& source_;
};

// Charged for nothing but the pages, as the others are.
std::unique_ptr<CacheDesign> makeLru(PageNumber, std::size_t frames, PageSource& source) {
  rocksdb::LRUCacheOptions options;
  options.capacity = frames * kBenchPageBytes;
  options.metadata_charge_policy = rocksdb::kDontChargeCacheMetadata;
  return std::make_unique<RocksDbCache>(rocksdb::NewLRUCache(options), source);
}

std::unique_ptr<CacheDesign> makeHyperClock(PageNumber, std::size_t frames, PageSource& source) {
  rocksdb::HyperClockCacheOptions options(frames * kBenchPageBytes, kBenchPageBytes);
  options.metadata_charge_policy = rocksdb::kDontChargeCacheMetadata;
  return std::make_unique<RocksDbCache>(options.MakeSharedCache(), source);
}

}  // namespace

std::vector<NamedDesign> rocksDbDesigns() {
  return {{"RocksDB LRUCache", true, makeLru}, {"RocksDB HyperClockCache", true, makeHyperClock}};
}

}  // namespace surfeit
