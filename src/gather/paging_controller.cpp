#include "gather/paging_controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gather/cache_split.h"

namespace surfeit {
namespace {

// The time between two looks at the caches, and the ticks until old look-ups count half.
constexpr double kTickSeconds = 0.25;
constexpr std::uint64_t kTicksPerHalving = 8;

// Narrower runs when repeated reads rise above what is usual by this factor.
constexpr double kRise = 1.5;
constexpr double kUsual = 0.2;  // weight of the newest tick in what is usual
// Fewer repeated reads of a tick than this say nothing.
constexpr std::uint64_t kLeastMisses = 32;

// Shares of the threads' time in waiting for pages: above the first, pages are read ahead; below
// the second, not so far.
constexpr double kMuchStall = 0.02, kLittleStall = 0.005;
// Pages read ahead fill no more than this part of a cache, lest they go before they are used.
constexpr double kAheadPart = 0.125;

// A new split must save this part of the loading, and moves at most a tenth of the memory at once.
constexpr double kSplitGain = 0.05;
constexpr std::size_t kSplitStep = 10;

// Memory is short when so many reads repeat an earlier one. The working set is what a cache must
// hold to stay below that. Advice waits until this part of the receivers is done.
constexpr double kMuchRepeated = 0.1;
constexpr double kAdvicePart = 0.05;

double sinceThen(std::uint64_t now_ns, std::uint64_t then_ns) {
  return double(now_ns - then_ns) * 1e-9;
}

std::uint64_t loads(const CacheCounters& counters) { return counters.misses + counters.prefetches; }

double secondsPerLoad(const CacheCounters& counters) {
  return loads(counters) > 0 ? double(counters.load_ns) * 1e-9 / double(loads(counters)) : 0;
}

GatherCacheStats statsOf(const CacheCounters& now, const CacheCounters& then = {}) {
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
          .load_seconds = sinceThen(now.load_ns, then.load_ns),
          .stall_seconds = sinceThen(now.stall_ns, then.stall_ns),
          .peak_bytes = now.peak_bytes,
          .budget_bytes = now.budget_bytes,
          .decoded_bytes = now.decoded_bytes};
}

GatherCacheStats statsSoFar(const CacheCounters& counters, const ReuseDistances& distances,
                            std::size_t frame_bytes) {
  GatherCacheStats stats = statsOf(counters);
  const MissRatioCurve curve = distances.curve(counters.requests);
  const double most_misses = curve.unavoidableMisses() / (1 - kMuchRepeated);
  stats.working_set_bytes =
      curve.framesForMisses(most_misses).value_or(curve.saturation()) * frame_bytes;
  return stats;
}

void add(GatherCacheStats& sum, const GatherCacheStats& other) {
  sum.requests += other.requests;
  sum.hits += other.hits;
  sum.front_hits += other.front_hits;
  sum.shared_hits += other.shared_hits;
  sum.waits += other.waits;
  sum.misses += other.misses;
  sum.prefetches += other.prefetches;
  sum.repeated_loads += other.repeated_loads;
  sum.evictions += other.evictions;
  sum.bytes_read += other.bytes_read;
  sum.repeated_bytes += other.repeated_bytes;
  sum.load_seconds += other.load_seconds;
  sum.stall_seconds += other.stall_seconds;
  sum.peak_bytes = other.peak_bytes;
  sum.budget_bytes = other.budget_bytes;
  sum.working_set_bytes = std::max(sum.working_set_bytes, other.working_set_bytes);
}

std::string mebibytes(double bytes) { return fmt::format("{:.0f}M", std::ceil(bytes / (1 << 20))); }

}  // namespace

PagingController::PagingController(PagedOctree& octree, const Options& options, Progress& progress)
    : octree_(octree),
      options_(options),
      progress_(progress),
      next_tick_ns_(std::int64_t(kTickSeconds * 1e9)),
      window_seconds_(kTickSeconds) {
  windows_.reserve(kMostWindows);
  last_window_ = count();  // with what was loaded to stay resident
  last_window_.seconds = 0;
  last_tick_ = last_window_;
}

std::uint64_t PagingController::memoryBytes() {
  return sizeof(PagingController) + kMostWindows * sizeof(GatherWindow);
}

double PagingController::secondsSinceStart() const {
  return std::chrono::duration<double>(Clock::now() - start_).count();
}

PagingController::Counters PagingController::count() const {
  return {octree_.nodeCounters(), octree_.surfelCounters(), receivers_, secondsSinceStart()};
}

bool PagingController::advance(std::uint64_t receivers) {
  receivers_.fetch_add(receivers, std::memory_order_relaxed);
  if (std::chrono::nanoseconds(Clock::now() - start_).count() < next_tick_ns_) return false;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return false;
  tick();
  next_tick_ns_ = std::int64_t((secondsSinceStart() + kTickSeconds) * 1e9);
  return true;
}

void PagingController::finish() {
  const std::lock_guard lock(mutex_);
  const Counters now = count();
  record(now);
  advise(now);
}

void PagingController::tick() {
  const Counters now = count();
  ++ticks_;
  adaptRun(now);
  if (options_.prefetches) adaptPrefetch(now);
  if (options_.adapts_split) adaptSplit(now);
  if (ticks_ % kTicksPerHalving == 0) {
    octree_.nodeDistances()->endWindow(now.nodes.requests);
    octree_.surfelDistances()->endWindow(now.surfels.requests);
    if (double(now.receivers) > kAdvicePart * double(options_.receivers)) advise(now);
  }
  if (now.seconds - last_window_.seconds >= window_seconds_) record(now);
  last_tick_ = now;
}

// All threads together work on a stretch of the curve of a run each. When more look-ups than is usual
// miss pages that were there before, or many of all reads repeat, a shorter stretch touches fewer
// pages at a time; when few do, a longer one lets threads find more in their own fronts. First reads
// of pages are no sign of anything.
void PagingController::adaptRun(const Counters& now) {
  const auto grown = [&](std::uint64_t CacheCounters::*count) {
    return double(now.nodes.*count - last_tick_.nodes.*count + now.surfels.*count -
                  last_tick_.surfels.*count);
  };
  const double repeated = grown(&CacheCounters::repeated_loads);
  const double loaded = grown(&CacheCounters::misses) + grown(&CacheCounters::prefetches);
  const double rate = repeated / std::max(grown(&CacheCounters::requests), 1.0);
  const std::uint64_t run = run_receivers_;
  const bool rises = usual_repeat_rate_ >= 0 && rate > kRise * usual_repeat_rate_;
  if (repeated >= kLeastMisses && (rises || repeated > kMuchRepeated * loaded)) {
    run_receivers_ = std::max(run / 2, kLeastRun);
  } else if (repeated < kMuchRepeated / 2 * loaded && ticks_ % kTicksPerHalving == 0) {
    run_receivers_ = std::min(run * 2, kMostRun);
  }
  usual_repeat_rate_ =
      usual_repeat_rate_ < 0 ? rate : usual_repeat_rate_ + kUsual * (rate - usual_repeat_rate_);
}

// As far ahead as loads take: the receivers that are gathered in the time of some loads, further
// while threads still wait, back when they do not.
void PagingController::adaptPrefetch(const Counters& now) {
  const double seconds = std::max(now.seconds - last_tick_.seconds, 1e-3);
  const double receivers = double(now.receivers - last_tick_.receivers);
  const double stalled = sinceThen(now.nodes.stall_ns, last_tick_.nodes.stall_ns) +
                         sinceThen(now.surfels.stall_ns, last_tick_.surfels.stall_ns);
  const double share = stalled / (seconds * options_.threads);
  std::uint64_t depth = prefetch_receivers_;
  if (share > kMuchStall) {
    const double load = std::max(secondsPerLoad(now.nodes), secondsPerLoad(now.surfels));
    const double during_load = load * receivers / seconds;
    const std::uint64_t least = static_cast<std::uint64_t>(options_.threads) * run_receivers_ +
                                std::uint64_t(4 * during_load);
    depth = std::max(2 * depth, least);
  } else if (share < kLittleStall) {
    depth /= 2;
    if (depth < static_cast<std::uint64_t>(options_.threads) * kLeastRun) depth = 0;
  }

  // Nothing may be gone before it is used
  const auto most = [&](const CacheCounters& cache, const CacheCounters& before,
                        std::size_t frames) {
    const double per_receiver = double(loads(cache) - loads(before)) / std::max(receivers, 1.0);
    return kAheadPart * double(frames) / std::max(per_receiver, 1e-9);
  };
  const double limit =
      std::min(most(now.nodes, last_tick_.nodes, octree_.nodeCache().frameLimit()),
               most(now.surfels, last_tick_.surfels, octree_.surfelCache().frameLimit()));
  depth = std::min(depth, kMostDepth);
  if (limit < double(depth)) depth = std::uint64_t(limit);
  prefetch_receivers_ = depth;
}

void PagingController::adaptSplit(const Counters& now) {
  const SceneFile& file = octree_.file();
  const CacheDemand nodes{octree_.nodeDistances()->recentCurve(now.nodes.requests),
                          secondsPerLoad(now.nodes), PagedOctree::nodeFrameBytes(file),
                          options_.least_node_frames, file.nodePageCount()};
  const CacheDemand surfels{octree_.surfelDistances()->recentCurve(now.surfels.requests),
                            secondsPerLoad(now.surfels), PagedOctree::surfelFrameBytes(file),
                            options_.least_surfel_frames, file.surfelPageCount()};
  const std::size_t node_frames = octree_.nodeCache().frameLimit();
  const std::size_t surfel_frames = octree_.surfelCache().frameLimit();
  const std::size_t total = node_frames * nodes.frame_bytes + surfel_frames * surfels.frame_bytes;

  const std::size_t best = bestFrames(nodes, surfels, total, node_frames);
  const auto cost = [&](std::size_t frames) {
    return loadSeconds(nodes, frames) +
           loadSeconds(surfels, (total - frames * nodes.frame_bytes) / surfels.frame_bytes);
  };
  if (cost(best) > (1 - kSplitGain) * cost(node_frames)) return;
  const std::size_t step = std::max<std::size_t>(total / kSplitStep / nodes.frame_bytes, 1);
  const std::size_t frames =
      std::clamp(best, node_frames - std::min(step, node_frames), node_frames + step);
  const std::size_t surfels_left = (total - frames * nodes.frame_bytes) / surfels.frame_bytes;
  if (frames == node_frames || surfels_left < options_.least_surfel_frames) return;

  // The one that falls goes first, so that both together are never above the budget
  if (frames < node_frames) octree_.nodeCache().setFrameLimit(frames);
  octree_.surfelCache().setFrameLimit(surfels_left);
  if (frames > node_frames) octree_.nodeCache().setFrameLimit(frames);
}

// Says once that more memory would help, and how much.
void PagingController::advise(const Counters& now) {
  if (has_advised_) return;
  const std::uint64_t all = loads(now.nodes) + loads(now.surfels);
  const std::uint64_t repeated = now.nodes.repeated_loads + now.surfels.repeated_loads;
  if (double(repeated) <= kMuchRepeated * double(all) || repeated < kLeastMisses) return;
  const GatherCacheStats nodes = nodeStats(), surfels = surfelStats();
  const double short_of = double(nodes.working_set_bytes) + double(surfels.working_set_bytes) -
                          double(nodes.budget_bytes) - double(surfels.budget_bytes);
  if (short_of <= 0) return;
  has_advised_ = true;
  progress_.note(fmt::format(
      "memory: {:.0f} % of the pages read were read before and evicted; the budget of {} is below "
      "the working set, --memory {} would do",
      100 * double(repeated) / double(all), mebibytes(double(options_.memory_bytes)),
      mebibytes(double(options_.memory_bytes) + short_of)));
}

void PagingController::record(const Counters& now) {
  if (windows_.size() == kMostWindows) mergeWindows();
  const SceneFile& file = octree_.file();
  GatherWindow& window = windows_.emplace_back();
  window.begin_seconds = last_window_.seconds;
  window.end_seconds = now.seconds;
  window.receivers = now.receivers - last_window_.receivers;
  window.run_receivers = run_receivers_;
  window.prefetch_receivers = prefetch_receivers_;
  window.node_cache = statsOf(now.nodes, last_window_.nodes);
  window.surfel_cache = statsOf(now.surfels, last_window_.surfels);
  window.node_cache.working_set_bytes =
      octree_.nodeDistances()->windowPages() * PagedOctree::nodeFrameBytes(file);
  window.surfel_cache.working_set_bytes =
      octree_.surfelDistances()->windowPages() * PagedOctree::surfelFrameBytes(file);
  last_window_ = now;
}

// Windows of twice the length, half as many.
void PagingController::mergeWindows() {
  for (std::size_t i = 0; i + 1 < windows_.size(); i += 2) {
    GatherWindow& merged = windows_[i / 2];
    const GatherWindow& second = windows_[i + 1];
    merged = windows_[i];
    merged.end_seconds = second.end_seconds;
    merged.receivers += second.receivers;
    merged.run_receivers = second.run_receivers;
    merged.prefetch_receivers = second.prefetch_receivers;
    add(merged.node_cache, second.node_cache);
    add(merged.surfel_cache, second.surfel_cache);
  }
  windows_.resize(windows_.size() / 2);
  window_seconds_ *= 2;
}

GatherCacheStats PagingController::nodeStats() const {
  return statsSoFar(octree_.nodeCounters(), *octree_.nodeDistances(),
                    PagedOctree::nodeFrameBytes(octree_.file()));
}

GatherCacheStats PagingController::surfelStats() const {
  return statsSoFar(octree_.surfelCounters(), *octree_.surfelDistances(),
                    PagedOctree::surfelFrameBytes(octree_.file()));
}

}  // namespace surfeit
