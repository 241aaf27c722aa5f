#include "gather/paging_controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/seconds_since.h"
#include "gather/cache_split.h"
#include "gather/memory_advice.h"
#include "surfeit/tune.h"

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

// Many reads repeat an earlier one. The working set is what a cache must hold to stay below that.
constexpr double kMuchRepeated = 0.1;

std::uint64_t loads(const CacheCounters& counters) { return counters.misses + counters.prefetches; }

double secondsPerLoad(const CacheCounters& counters) {
  return loads(counters) > 0 ? double(counters.load_ns) * 1e-9 / double(loads(counters)) : 0;
}

GatherCacheStats statsSoFar(const CacheCounters& counters, const ReuseDistances& distances,
                            std::size_t frame_bytes) {
  GatherCacheStats stats = statsBetween({}, counters);
  const MissRatioCurve curve = distances.curve(counters.requests);
  const double most_misses = curve.unavoidableMisses() / (1 - kMuchRepeated);
  stats.working_set_bytes =
      curve.framesForMisses(most_misses).value_or(curve.saturation()) * frame_bytes;
  return stats;
}

// As --memory takes it.
std::string mebibytes(std::uint64_t bytes) {
  return fmt::format("{:.0f}M", std::ceil(double(bytes) / (1 << 20)));
}

}  // namespace

PagingController::PagingController(PagedOctree& octree, const Options& options, Progress& progress)
    : octree_(octree),
      options_(options),
      progress_(progress),
      frame_bytes_(octree.nodeCache().frameLimit() * PagedOctree::nodeFrameBytes(octree.file()) +
                   octree.surfelCache().frameLimit() *
                       PagedOctree::surfelFrameBytes(octree.file())),
      next_tick_ns_(std::int64_t(kTickSeconds * 1e9)),
      last_tick_(now()),  // with what was loaded to stay resident
      record_(
          [this] {
            Moment begin = last_tick_;
            begin.seconds = 0;
            return begin;
          }(),
          kTickSeconds) {}

double PagingController::secondsSinceStart() const { return secondsSince(start_); }

PagingController::Moment PagingController::now() const {
  return {.seconds = secondsSinceStart(),
          .receivers = receivers_,
          .run_receivers = run_receivers_,
          .prefetch_receivers = prefetch_receivers_,
          .nodes = octree_.nodeCache().counters(),
          .surfels = octree_.surfelCache().counters(),
          .node_working_set_bytes = node_working_set_bytes_,
          .surfel_working_set_bytes = surfel_working_set_bytes_};
}

void PagingController::advance(std::uint64_t receivers) {
  receivers_.fetch_add(receivers, std::memory_order_relaxed);
  if (std::chrono::nanoseconds(Clock::now() - start_).count() < next_tick_ns_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  tick();
  next_tick_ns_ = std::int64_t((secondsSinceStart() + kTickSeconds) * 1e9);
}

void PagingController::finish() {
  const std::lock_guard lock(mutex_);
  noteWorkingSets(false);
  const Moment end = now();
  record_.add(end);
  advise(end);
}

void PagingController::tick() {
  Moment at = now();
  ++ticks_;
  adaptRun(at);
  if (options_.prefetches) adaptPrefetch(at);
  if (options_.adapts_split) adaptSplit(at);
  if (ticks_ % kTicksPerHalving == 0) {
    noteWorkingSets(true);
    octree_.nodeDistances()->endWindow(at.nodes.requests);
    octree_.surfelDistances()->endWindow(at.surfels.requests);
  }
  last_tick_ = at;
  if (record_.isDue(at.seconds)) record_.add(now());
}

// What was touched since the last halving. A stretch that the end of the gather cuts short has
// touched less than is usual.
void PagingController::noteWorkingSets(bool is_whole) {
  const SceneFile& file = octree_.file();
  const std::uint64_t nodes = octree_.nodeDistances()->windowPages();
  const std::uint64_t surfels = octree_.surfelDistances()->windowPages();
  const auto noted = [is_whole](std::uint64_t before, std::uint64_t bytes) {
    return is_whole ? bytes : std::max(before, bytes);
  };
  node_working_set_bytes_ =
      noted(node_working_set_bytes_, nodes * PagedOctree::nodeFrameBytes(file));
  surfel_working_set_bytes_ =
      noted(surfel_working_set_bytes_, surfels * PagedOctree::surfelFrameBytes(file));
}

// All threads together work on a stretch of the curve of a run each. When more look-ups than is
// usual miss pages that were there before, or many of all reads repeat, a shorter stretch touches
// fewer pages at a time; when few do, a longer one lets threads find more in their own fronts.
// First reads of pages are no sign of anything.
void PagingController::adaptRun(const Moment& now) {
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
void PagingController::adaptPrefetch(const Moment& now) {
  const double seconds = std::max(now.seconds - last_tick_.seconds, 1e-3);
  const double receivers = double(now.receivers - last_tick_.receivers);
  const double stalled = statsBetween(last_tick_.nodes, now.nodes).stall_seconds +
                         statsBetween(last_tick_.surfels, now.surfels).stall_seconds;
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

void PagingController::adaptSplit(const Moment& now) {
  const SceneFile& file = octree_.file();
  const CacheDemand nodes{octree_.nodeDistances()->recentCurve(now.nodes.requests),
                          secondsPerLoad(now.nodes), PagedOctree::nodeFrameBytes(file),
                          options_.least_node_frames, file.nodePageCount()};
  const CacheDemand surfels{octree_.surfelDistances()->recentCurve(now.surfels.requests),
                            secondsPerLoad(now.surfels), PagedOctree::surfelFrameBytes(file),
                            options_.least_surfel_frames, file.surfelPageCount()};
  const std::size_t node_frames = octree_.nodeCache().frameLimit();
  const CacheSplit best = bestSplit(nodes, surfels, frame_bytes_, node_frames);
  const CacheSplit current = splitAt(nodes, surfels, frame_bytes_, node_frames);
  if (best.load_seconds > (1 - kSplitGain) * current.load_seconds) return;
  const std::size_t step = std::max<std::size_t>(frame_bytes_ / kSplitStep / nodes.frame_bytes, 1);
  const CacheSplit next = splitAt(
      nodes, surfels, frame_bytes_,
      std::clamp(best.first_frames, node_frames - std::min(step, node_frames), node_frames + step));
  if (next.second_frames < options_.least_surfel_frames) return;

  // The one that falls goes first, so that both together are never above the budget
  if (next.first_frames < node_frames) octree_.nodeCache().setFrameLimit(next.first_frames);
  octree_.surfelCache().setFrameLimit(next.second_frames);
  if (next.first_frames > node_frames) octree_.nodeCache().setFrameLimit(next.first_frames);
}

// Says what budget would do where this one is too small (memory_advice.h has the rule).
void PagingController::advise(const Moment& now) const {
  const SceneFile& file = octree_.file();
  if (now.nodes.repeated_loads + now.surfels.repeated_loads < kLeastMisses) return;
  const Result<GatherMemory> plan = planGatherMemory(file, options_.memory_bytes, options_.work);
  if (!plan.ok()) return;  // the frames were given, and no budget
  const GatherLoads loads = {octree_.nodeDistances()->curve(now.nodes.requests),
                             octree_.surfelDistances()->curve(now.surfels.requests),
                             secondsPerLoad(now.nodes), secondsPerLoad(now.surfels)};

  // All seconds are those of all threads together. Who reads ahead takes time from the others,
  // unless there are processors to spare: then this advises too much rather than too little
  const double stalled = double(now.nodes.stall_ns + now.surfels.stall_ns) * 1e-9;
  const double ahead = double(now.nodes.prefetches) * loads.node_load_seconds +
                       double(now.surfels.prefetches) * loads.surfel_load_seconds;
  const double working = std::max(now.seconds * options_.threads - stalled - ahead, 0.0);
  const std::optional<MemoryAdvice> advice = adviseMemory(file, *plan, loads, working);
  if (!advice) return;
  progress_.inform(fmt::format(
      "memory: to read pages again that were evicted takes {:.0f} % of the time with {}; --memory "
      "{} would do",
      100 * advice->part_of_time, mebibytes(options_.memory_bytes + options_.beside_bytes),
      mebibytes(advice->memory_bytes + options_.beside_bytes)));
}

GatherCacheStats PagingController::nodeStats() const {
  return statsSoFar(octree_.nodeCache().counters(), *octree_.nodeDistances(),
                    PagedOctree::nodeFrameBytes(octree_.file()));
}

GatherCacheStats PagingController::surfelStats() const {
  return statsSoFar(octree_.surfelCache().counters(), *octree_.surfelDistances(),
                    PagedOctree::surfelFrameBytes(octree_.file()));
}

}  // namespace surfeit
