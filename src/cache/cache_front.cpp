#include "cache/cache_front.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <utility>

#include "cache/reuse_distances.h"

namespace surfeit {

CacheFront::CacheFront(PageCache& cache, std::size_t slots, Role role)
    : cache_(cache),
      role_(role),
      resident_(cache.resident_),
      slots_(std::bit_floor(std::max<std::size_t>(slots, 1))),
      mask_(static_cast<PageNumber>(slots_.size() - 1)),
      announced_(std::make_unique<std::atomic<PageNumber>[]>(slots_.size())) {
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) announced_[slot] = kNoPage;
  const std::lock_guard lock(cache_.mutex_);
  cache_.fronts_.push_back(this);
}

CacheFront::~CacheFront() {
  release();
  const std::lock_guard lock(cache_.mutex_);
  addTo(cache_.counts_);
  std::erase(cache_.fronts_, this);
}

void CacheFront::release() {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i].page == kEmpty) continue;
    cache_.stamp(static_cast<PageNumber>(slots_[i].page));
    announce(i, kNoPage);
    cache_.noteRelease(slots_[i].data.data());
    slots_[i] = {};
  }
}

void CacheFront::addTo(CacheCounters& counters) const {
  if (role_ == Role::kPrefetch) return;
  counters.front_hits += front_hits_.load(std::memory_order_relaxed);
  counters.shared_hits += shared_hits_.load(std::memory_order_relaxed);
  counters.waits += waits_.load(std::memory_order_relaxed);
  counters.stall_ns += stall_ns_.load(std::memory_order_relaxed);
}

bool CacheFront::takeLoaded(PageNumber page) {
  if (page >= cache_.pageCount()) return false;
  noteReuse(page);
  const std::size_t index = page & mask_;
  Slot& slot = slots_[index];
  const std::uint64_t before = std::exchange(slot.page, kEmpty);
  if (before != kEmpty) cache_.stamp(static_cast<PageNumber>(before));
  announce(index, page);
  if (before != kEmpty) cache_.noteRelease(slot.data.data());
  slot.data = cache_.findLoaded(page);
  if (slot.data.data() == nullptr) {
    announce(index, kNoPage);  // to hold no other thread up while this one waits
    return false;
  }
  slot.page = page;
  count(shared_hits_);
  return true;
}

Result<std::span<const std::byte>> CacheFront::loadIntoSlot(PageNumber page) {
  if (page >= cache_.pageCount()) return noSuchPage(page);
  SURFEIT_ASSIGN_OR_RETURN(const PageCache::Pin pin, pinOrLoad(page));
  const std::size_t index = page & mask_;
  announce(index, page);  // before the pin goes
  slots_[index] = {page, pin.data()};
  return pin.data();
}

Result<PageCache::Pin> CacheFront::pin(PageNumber page) {
  if (page >= cache_.pageCount()) return noSuchPage(page);
  noteReuse(page);
  PageCache::Pin pin;
  if (!cache_.tryPin(page, pin)) return pinOrLoad(page);
  count(shared_hits_);
  return pin;
}

void CacheFront::noteReuse(PageNumber page) const {
  ReuseDistances* const distances = cache_.options_.reuse_distances;
  if (distances != nullptr && role_ == Role::kRequests && distances->isSampled(page)) {
    distances->touch(page);
  }
}

Result<PageCache::Pin> CacheFront::pinOrLoad(PageNumber page) {
  using Outcome = PageCache::Request::Outcome;
  PageCache::Request request{.is_prefetch = role_ == Role::kPrefetch, .may_wait = false};
  Result<PageCache::Pin> pin = cache_.pinOrLoad(page, request);
  if (request.outcome == Outcome::kNoFrame) {
    release();
    if (yields_to_ != nullptr) yields_to_->release();
    request.may_wait = true;
    pin = cache_.pinOrLoad(page, request);
  }
  if (request.outcome != Outcome::kMissed) count(shared_hits_);
  if (request.outcome == Outcome::kWaited) count(waits_);
  count(stall_ns_, request.stall_ns);
  return pin;
}

Status CacheFront::noSuchPage(PageNumber page) const {
  return Status::corruption(
      fmt::format("page {} does not exist: expected less than {}", page, cache_.pageCount()));
}

}  // namespace surfeit
