#include "batch/paging_controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "batch/memory_advice.h"
#include "surfeit/tune.h"

namespace surfeit {
namespace {

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

// Many reads repeat an earlier one.
constexpr double kMuchRepeated = 0.1;

double secondsPerLoad(const CacheCounters& counters) {
  return CacheMonitor::secondsPerLoad(counters);
}

// As --memory takes it.
std::string mebibytes(std::uint64_t bytes) {
  return fmt::format("{:.0f}M", std::ceil(double(bytes) / (1 << 20)));
}

}  // namespace

PagingController::PagingController(const World& world, const Options& options, Progress& progress)
    : file_(world.file()),
      caches_(*world.engine().caches),
      monitor_(world.engine().monitor),
      options_(options),
      progress_(progress) {
  monitor_.noteRuns(run_receivers_, prefetch_receivers_);
}

void PagingController::advance(std::uint64_t receivers) {
  const std::optional<Tick> tick = monitor_.advance(receivers);
  if (!tick) return;
  const std::lock_guard lock(mutex_);
  adaptRun(*tick);
  if (options_.prefetches) adaptPrefetch(*tick);
  monitor_.noteRuns(run_receivers_, prefetch_receivers_);
}

void PagingController::finish() {
  monitor_.finish();
  const std::lock_guard lock(mutex_);
  advise();
}

// All threads together work on a stretch of the curve of a run each. When more look-ups than is
// usual miss pages that were there before, or many of all reads repeat, a shorter stretch touches
// fewer pages at a time; when few do, a longer one lets threads find more in their own fronts.
// First reads of pages are no sign of anything.
void PagingController::adaptRun(const Tick& tick) {
  const auto& [before, now, is_long] = tick;
  const auto grown = [&](std::uint64_t CacheCounters::*count) {
    return double(tick.now.nodes.*count - tick.before.nodes.*count + tick.now.surfels.*count -
                  tick.before.surfels.*count);
  };
  const double repeated = grown(&CacheCounters::repeated_loads);
  const double loaded = grown(&CacheCounters::misses) + grown(&CacheCounters::prefetches);
  const double rate = repeated / std::max(grown(&CacheCounters::requests), 1.0);
  const std::uint64_t run = run_receivers_;
  const bool rises = usual_repeat_rate_ >= 0 && rate > kRise * usual_repeat_rate_;
  if (repeated >= kLeastMisses && (rises || repeated > kMuchRepeated * loaded)) {
    run_receivers_ = std::max(run / 2, kLeastRun);
  } else if (repeated < kMuchRepeated / 2 * loaded && is_long) {
    run_receivers_ = std::min(run * 2, kMostRun);
  }
  usual_repeat_rate_ =
      usual_repeat_rate_ < 0 ? rate : usual_repeat_rate_ + kUsual * (rate - usual_repeat_rate_);
}

// As far ahead as loads take: the receivers that are gathered in the time of some loads, further
// while threads still wait, back when they do not.
void PagingController::adaptPrefetch(const Tick& tick) {
  const CacheMonitor::Moment& before = tick.before;
  const CacheMonitor::Moment& now = tick.now;
  const double seconds = std::max(now.seconds - before.seconds, 1e-3);
  const double receivers = double(now.receivers - before.receivers);
  const double stalled = statsBetween(before.nodes, now.nodes).stall_seconds +
                         statsBetween(before.surfels, now.surfels).stall_seconds;
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
  const auto most = [&](const CacheCounters& cache, const CacheCounters& then, std::size_t frames) {
    const double per_receiver =
        double(CacheMonitor::loads(cache) - CacheMonitor::loads(then)) / std::max(receivers, 1.0);
    return kAheadPart * double(frames) / std::max(per_receiver, 1e-9);
  };
  const double limit = std::min(most(now.nodes, before.nodes, caches_.nodes().frameLimit()),
                                most(now.surfels, before.surfels, caches_.surfels().frameLimit()));
  depth = std::min(depth, kMostDepth);
  if (limit < double(depth)) depth = std::uint64_t(limit);
  prefetch_receivers_ = depth;
}

// Says what budget would do where this one is too small (memory_advice.h has the rule).
void PagingController::advise() const {
  if (options_.is_warm) return;  // look-ups of all gathers are counted together; the first has told
  const CacheMonitor::Moment now = monitor_.now();
  if (now.nodes.repeated_loads + now.surfels.repeated_loads < kLeastMisses) return;
  const Result<GatherMemory> plan = planGatherMemory(file_, options_.memory_bytes, options_.work);
  if (!plan.ok()) return;  // the frames were given, and no budget
  const GatherLoads loads = {caches_.nodeDistances()->curve(now.nodes.requests),
                             caches_.surfelDistances()->curve(now.surfels.requests),
                             secondsPerLoad(now.nodes), secondsPerLoad(now.surfels)};

  // All seconds are those of all threads together. Who reads ahead takes time from the others,
  // unless there are processors to spare: then this advises too much rather than too little
  const double stalled = double(now.nodes.stall_ns + now.surfels.stall_ns) * 1e-9;
  const double ahead = double(now.nodes.prefetches) * loads.node_load_seconds +
                       double(now.surfels.prefetches) * loads.surfel_load_seconds;
  const double working = std::max(now.seconds * options_.threads - stalled - ahead, 0.0);
  const std::optional<MemoryAdvice> advice = adviseMemory(file_, *plan, loads, working);
  if (!advice) return;
  progress_.inform(fmt::format(
      "memory: to read pages again that were evicted takes {:.0f} % of the time with {}; --memory "
      "{} would do",
      100 * advice->part_of_time, mebibytes(options_.memory_bytes + options_.beside_bytes),
      mebibytes(advice->memory_bytes + options_.beside_bytes)));
}

}  // namespace surfeit
