#include "engine/cache_monitor.h"

#include <algorithm>

#include "core/seconds_since.h"
#include "engine/cache_split.h"

namespace surfeit {
namespace {

// The time between two looks at the caches, and the ticks until old look-ups count half.
constexpr double kTickSeconds = 0.25;
constexpr std::uint64_t kTicksPerHalving = 8;

// A new split must save this part of the loading, and moves at most a tenth of the memory at once.
constexpr double kSplitGain = 0.05;
constexpr std::size_t kSplitStep = 10;

// Many reads repeat an earlier one. The working set is what a cache must hold to stay below that.
constexpr double kMuchRepeated = 0.1;

GatherCacheStats statsSoFar(const CacheCounters& first, const CacheCounters& counters,
                            const ReuseDistances& distances, std::size_t frame_bytes) {
  GatherCacheStats stats = statsBetween(first, counters);
  const MissRatioCurve curve = distances.curve(counters.requests);
  const double most_misses = curve.unavoidableMisses() / (1 - kMuchRepeated);
  stats.working_set_bytes =
      curve.framesForMisses(most_misses).value_or(curve.saturation()) * frame_bytes;
  return stats;
}

}  // namespace

double CacheMonitor::secondsPerLoad(const CacheCounters& counters) {
  return loads(counters) > 0 ? double(counters.load_ns) * 1e-9 / double(loads(counters)) : 0;
}

CacheMonitor::CacheMonitor(OctreeCaches& caches, const Options& options)
    : caches_(caches),
      next_tick_ns_(std::int64_t(kTickSeconds * 1e9)),
      options_(options),
      frame_bytes_(caches.nodes().frameLimit() * caches.nodeFrameBytes() +
                   caches.surfels().frameLimit() * caches.surfelFrameBytes()),
      last_tick_(now()),  // with what was loaded to stay resident
      record_(
          [this] {
            Moment begin = last_tick_;
            begin.seconds = 0;
            return begin;
          }(),
          kTickSeconds) {
  if (!options.is_warm) return;
  first_nodes_ = last_tick_.nodes;
  first_surfels_ = last_tick_.surfels;
}

double CacheMonitor::seconds() const { return secondsSince(start_); }

CacheMonitor::Moment CacheMonitor::now() const {
  return {.seconds = seconds(),
          .receivers = receivers_,
          .run_receivers = run_receivers_,
          .prefetch_receivers = prefetch_receivers_,
          .nodes = caches_.nodes().counters(),
          .surfels = caches_.surfels().counters(),
          .node_working_set_bytes = node_working_set_bytes_,
          .surfel_working_set_bytes = surfel_working_set_bytes_};
}

std::optional<CacheMonitor::Tick> CacheMonitor::advance(std::uint64_t receivers) {
  receivers_.fetch_add(receivers, std::memory_order_relaxed);
  if (std::chrono::nanoseconds(Clock::now() - start_).count() < next_tick_ns_) return std::nullopt;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return std::nullopt;
  // Another thread may have looked between the two lines above
  if (std::chrono::nanoseconds(Clock::now() - start_).count() < next_tick_ns_) return std::nullopt;

  const Moment at = now();
  ++ticks_;
  const Tick tick = {last_tick_, at, ticks_ % kTicksPerHalving == 0};
  if (options_.adapts_split) adaptSplit(at);
  if (tick.is_long) {
    noteWorkingSets(true);
    caches_.nodeDistances()->endWindow(at.nodes.requests);
    caches_.surfelDistances()->endWindow(at.surfels.requests);
  }
  last_tick_ = at;
  if (record_.isDue(at.seconds)) record_.add(now());
  next_tick_ns_ = std::int64_t((seconds() + kTickSeconds) * 1e9);
  return tick;
}

void CacheMonitor::finish() {
  const std::lock_guard lock(mutex_);
  noteWorkingSets(false);
  record_.add(now());
}

std::vector<GatherWindow> CacheMonitor::windows(bool has_last) const {
  const std::lock_guard lock(mutex_);
  if (!has_last) return record_.windows();
  WindowRecord record = record_;
  record.add(now());
  return record.windows();
}

// What was touched since the last halving. A stretch that the end of the gather cuts short has
// touched less than is usual.
void CacheMonitor::noteWorkingSets(bool is_whole) {
  const std::uint64_t nodes = caches_.nodeDistances()->windowPages();
  const std::uint64_t surfels = caches_.surfelDistances()->windowPages();
  const auto noted = [is_whole](std::uint64_t before, std::uint64_t bytes) {
    return is_whole ? bytes : std::max(before, bytes);
  };
  node_working_set_bytes_ = noted(node_working_set_bytes_, nodes * caches_.nodeFrameBytes());
  surfel_working_set_bytes_ =
      noted(surfel_working_set_bytes_, surfels * caches_.surfelFrameBytes());
}

void CacheMonitor::adaptSplit(const Moment& now) {
  if (caches_.nodes().frameLimit() >= caches_.nodePages() &&
      caches_.surfels().frameLimit() >= caches_.surfelPages()) {
    return;  // both hold all that there is
  }
  const CacheDemand nodes{caches_.nodeDistances()->recentCurve(now.nodes.requests),
                          secondsPerLoad(now.nodes), caches_.nodeFrameBytes(),
                          options_.least_node_frames, caches_.nodePages()};
  const CacheDemand surfels{caches_.surfelDistances()->recentCurve(now.surfels.requests),
                            secondsPerLoad(now.surfels), caches_.surfelFrameBytes(),
                            options_.least_surfel_frames, caches_.surfelPages()};
  const std::size_t node_frames = caches_.nodes().frameLimit();
  const CacheSplit best = bestSplit(nodes, surfels, frame_bytes_, node_frames);
  const CacheSplit current = splitAt(nodes, surfels, frame_bytes_, node_frames);
  if (best.load_seconds > (1 - kSplitGain) * current.load_seconds) return;
  const std::size_t step = std::max<std::size_t>(frame_bytes_ / kSplitStep / nodes.frame_bytes, 1);
  const CacheSplit next = splitAt(
      nodes, surfels, frame_bytes_,
      std::clamp(best.first_frames, node_frames - std::min(step, node_frames), node_frames + step));
  if (next.second_frames < options_.least_surfel_frames) return;
  caches_.setFrameLimits(next.first_frames, next.second_frames);
}

void CacheMonitor::setFrames(std::size_t node_frames, std::size_t surfel_frames,
                             std::size_t least_node_frames, std::size_t least_surfel_frames) {
  const std::lock_guard lock(mutex_);
  caches_.setFrameLimits(node_frames, surfel_frames);
  options_.least_node_frames = least_node_frames;
  options_.least_surfel_frames = least_surfel_frames;
  frame_bytes_ =
      node_frames * caches_.nodeFrameBytes() + surfel_frames * caches_.surfelFrameBytes();
}

GatherCacheStats CacheMonitor::nodeStats() const {
  return statsSoFar(first_nodes_, caches_.nodes().counters(), *caches_.nodeDistances(),
                    caches_.nodeFrameBytes());
}

GatherCacheStats CacheMonitor::surfelStats() const {
  return statsSoFar(first_surfels_, caches_.surfels().counters(), *caches_.surfelDistances(),
                    caches_.surfelFrameBytes());
}

}  // namespace surfeit
