#include "engine/window_record.h"

#include <algorithm>

namespace surfeit {
namespace {

double secondsBetween(std::uint64_t then_ns, std::uint64_t now_ns) {
  return double(now_ns - then_ns) * 1e-9;
}

}  // namespace

GatherCacheStats statsBetween(const CacheCounters& then, const CacheCounters& now) {
  return {.requests = now.requests - then.requests,
          .hits = now.hits - then.hits,
          .front_hits = now.front_hits - then.front_hits,
          .shared_hits = now.shared_hits - then.shared_hits,
          .waits = now.waits - then.waits,
          .misses = now.misses - then.misses,
          .prefetches = now.prefetches - then.prefetches,
          .repeated_loads = now.repeated_loads - then.repeated_loads,
          .evictions = now.evictions - then.evictions,
          .bytes_read = now.bytes_read - then.bytes_read,
          .repeated_bytes = now.repeated_bytes - then.repeated_bytes,
          .load_seconds = secondsBetween(then.load_ns, now.load_ns),
          .stall_seconds = secondsBetween(then.stall_ns, now.stall_ns),
          .peak_bytes = now.peak_bytes,
          .budget_bytes = now.budget_bytes,
          .decoded_bytes = now.decoded_bytes};
}

WindowRecord::WindowRecord(const Moment& begin, double window_seconds)
    : begin_(begin), window_seconds_(window_seconds) {
  ends_.reserve(kMostWindows);
}

void WindowRecord::add(const Moment& end) {
  if (ends_.size() == kMostWindows) {
    // Counts are those since the beginning, so that two windows join when the end between them goes
    for (std::size_t i = 0; i < kMostWindows / 2; ++i) {
      const Moment& first = ends_[2 * i];
      Moment joined = ends_[2 * i + 1];
      joined.node_working_set_bytes =
          std::max(joined.node_working_set_bytes, first.node_working_set_bytes);
      joined.surfel_working_set_bytes =
          std::max(joined.surfel_working_set_bytes, first.surfel_working_set_bytes);
      ends_[i] = joined;
    }
    ends_.resize(kMostWindows / 2);
    window_seconds_ *= 2;
  }
  ends_.push_back(end);
}

std::vector<GatherWindow> WindowRecord::windows() const {
  std::vector<GatherWindow> windows;
  windows.reserve(ends_.size());
  const Moment* begin = &begin_;
  for (const Moment& end : ends_) {
    GatherWindow& window = windows.emplace_back();
    window.begin_seconds = begin->seconds;
    window.end_seconds = end.seconds;
    window.receivers = end.receivers - begin->receivers;
    window.run_receivers = end.run_receivers;
    window.prefetch_receivers = end.prefetch_receivers;
    window.node_cache = statsBetween(begin->nodes, end.nodes);
    window.surfel_cache = statsBetween(begin->surfels, end.surfels);
    window.node_cache.working_set_bytes = end.node_working_set_bytes;
    window.surfel_cache.working_set_bytes = end.surfel_working_set_bytes;
    begin = &end;
  }
  return windows;
}

}  // namespace surfeit
