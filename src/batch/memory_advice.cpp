#include "batch/memory_advice.h"

#include <algorithm>

#include "surfeit/tune.h"

namespace surfeit {
namespace {

// Budgets are advised in whole units.
constexpr std::uint64_t kMemoryUnit = std::uint64_t{1} << 20;

}  // namespace

double GatherLoads::leastLoadSeconds() const {
  return node_curve.unavoidableMisses() * node_load_seconds +
         surfel_curve.unavoidableMisses() * surfel_load_seconds;
}

CacheSplit predictSplit(const SceneFile& file, const GatherMemory& plan, const GatherLoads& loads) {
  const PagedOctree::Memory& caches = plan.caches;
  const CacheDemand nodes{loads.node_curve, loads.node_load_seconds,
                          PagedOctree::nodeFrameBytes(file), caches.least_node_frames,
                          file.nodePageCount()};
  const CacheDemand surfels{loads.surfel_curve, loads.surfel_load_seconds,
                            PagedOctree::surfelFrameBytes(file), caches.least_surfel_frames,
                            file.surfelPageCount()};
  const std::size_t total =
      caches.node_frames * nodes.frame_bytes + caches.surfel_frames * surfels.frame_bytes;
  return plan.work.cache_split < 0 ? bestSplit(nodes, surfels, total, caches.node_frames)
                                   : splitAt(nodes, surfels, total, caches.node_frames);
}

std::uint64_t memoryForCaches(const SceneFile& file, const GatherWork& work,
                              std::uint64_t cache_bytes) {
  std::uint64_t low = leastGatherMemory(file, work);
  std::uint64_t high = std::max(low, gatherMemoryBesideCaches(file, work) + cache_bytes);
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    const Result<GatherMemory> plan = planGatherMemory(file, middle, work);
    if (plan.ok() && plan->cache_bytes >= cache_bytes) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return high;
}

std::uint64_t memoryForLoads(const SceneFile& file, const GatherWork& work,
                             const GatherLoads& loads, double most_load_seconds) {
  return leastMemoryThat(file, work, [&](const GatherMemory& plan) {
    return predictSplit(file, plan, loads).load_seconds <= most_load_seconds;
  });
}

std::uint64_t leastMemoryThat(const SceneFile& file, const GatherWork& work,
                              const std::function<bool(const GatherMemory&)>& is_enough) {
  const auto does = [&](std::uint64_t units) {
    const Result<GatherMemory> plan = planGatherMemory(file, units * kMemoryUnit, work);
    return plan.ok() && is_enough(*plan);
  };
  const std::uint64_t all = memoryForCaches(file, work, PagedOctree::unlimitedCacheBytes(file));
  std::uint64_t low = leastGatherMemory(file, work) / kMemoryUnit;  // does not, or is the least
  std::uint64_t high = all / kMemoryUnit + 1;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (does(middle)) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return high * kMemoryUnit;
}

std::optional<MemoryAdvice> adviseMemory(const SceneFile& file, const GatherMemory& plan,
                                         const GatherLoads& loads, double working_seconds) {
  const double least = loads.leastLoadSeconds();
  const double best = working_seconds + least;
  const double longer = predictSplit(file, plan, loads).load_seconds - least;
  if (longer <= kShortOfMemory * kTuneTimeMargin * best) return std::nullopt;
  const double most = least + kTuneTimeMargin * (working_seconds / kStarvedWork + least);
  return MemoryAdvice{memoryForLoads(file, plan.work, loads, most), longer / (best + longer)};
}

}  // namespace surfeit
