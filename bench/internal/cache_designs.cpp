#include "bench/internal/cache_designs.h"

#include <cstdlib>
#include <list>
#include <mutex>
#include <unordered_map>

#include "cache/cache_front.h"
#include "cache/page_cache.h"

namespace surfeit {
namespace {

class OwnCache : public CacheDesign {
 public:
  // With slots 0 every look-up pins and unpins in the shared cache.
  OwnCache(PageNumber page_count, std::size_t frames, PageSource& source, std::size_t slots)
      : slots_(slots) {
    auto cache = PageCache::create(
        {page_count, kBenchPageBytes, frames},
        [&source](PageNumber page, std::span<std::byte> frame) -> Result<PageCache::Loaded> {
          source.load(page, frame.data());
          return PageCache::Loaded{kBenchPageBytes, kBenchPageBytes};
        });
    if (!cache.ok()) std::abort();
    cache_ = std::move(*cache);
  }

  std::unique_ptr<CacheUser> makeUser() override {
    auto front = std::make_unique<CacheFront>(*cache_, slots_);
    if (slots_ > 0) {
      return makeLookupUser([front = std::move(front)](PageNumber page) {
        const auto data = front->lookup(page);
        return data.ok() && holdsPage(data->data(), page);
      });
    }
    return makeLookupUser([front = std::move(front)](PageNumber page) {
      const auto pin = front->pin(page);
      return pin.ok() && holdsPage(pin->data().data(), page);
    });
  }

 private:
  const std::size_t slots_;
  std::unique_ptr<PageCache> cache_;
};

class MutexList : public CacheDesign {
 public:
  MutexList(std::size_t frames, PageSource& source) : frames_(frames), source_(source) {}

  std::unique_ptr<CacheUser> makeUser() override {
    return makeLookupUser(
        [this](PageNumber page) { return holdsPage(lookup(page)->data(), page); });
  }

 private:
  using Data = std::shared_ptr<std::vector<std::byte>>;
  struct Entry {
    PageNumber page;
    Data data;
  };

  Data lookup(PageNumber page) {
    {
      const std::lock_guard lock(mutex_);
      const auto found = entries_.find(page);
      if (found != entries_.end()) {
        order_.splice(order_.begin(), order_, found->second);
        return found->second->data;
      }
    }
    auto data = std::make_shared<std::vector<std::byte>>(kBenchPageBytes);
    source_.load(page, data->data());
    const std::lock_guard lock(mutex_);
    const auto [at, is_new] = entries_.try_emplace(page);
    if (!is_new) return at->second->data;  // another thread was faster
    at->second = order_.insert(order_.begin(), {page, data});
    if (order_.size() > frames_) {
      entries_.erase(order_.back().page);
      order_.pop_back();
    }
    return data;
  }

  const std::size_t frames_;
  PageSource& source_;
  std::mutex mutex_;
  std::list<Entry> order_;  // most recent first
  std::unordered_map<PageNumber, std::list<Entry>::iterator> entries_;
};

}  // namespace

std::vector<NamedDesign> ownDesigns() {
  const auto own = [](std::size_t slots) {
    return [slots](PageNumber page_count, std::size_t frames, PageSource& source) {
      return std::make_unique<OwnCache>(page_count, frames, source, slots);
    };
  };
  return {{"surfeit, front of 64", false, own(64)},
          {"surfeit, no front", false, own(0)},
          {"mutex + list + map", false, [](PageNumber, std::size_t frames, PageSource& source) {
             return std::make_unique<MutexList>(frames, source);
           }}};
}

}  // namespace surfeit
