// How much of a gather's time goes into loading pages, at any budget: one rule for `tune`, which
// knows a sample of the look-ups, and for the monitor of a gather, which saw all of them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "batch/gather_memory.h"
#include "cache/miss_ratio_curve.h"
#include "engine/cache_split.h"

namespace surfeit {

// A budget is advised with which a gather takes no more than kTuneTimeMargin longer than with all
// pages in memory; it is called too small when it takes twice as much longer. Loads cost other
// times in each run, and whoever follows the advice is not advised again.
inline constexpr double kShortOfMemory = 2;

// What a gather works beside loads takes up to so many times as long where it has too little
// memory: evictions, processor caches that decoding empties (mostly 1 to 2 times, 4.3 at worst in
// gathers of random balls on a loaded machine). Advice counts on no more than the rest.
inline constexpr double kStarvedWork = 4;

// The look-ups of each cache, and the time that one thread spends on a load.
struct GatherLoads {
  MissRatioCurve node_curve, surfel_curve;
  double node_load_seconds = 0, surfel_load_seconds = 0;

  // With all pages in memory: every page once.
  double leastLoadSeconds() const;
};

// The split of the caches that a gather with this plan finds, or was given, and what it loads.
CacheSplit predictSplit(const SceneFile& file, const GatherMemory& plan, const GatherLoads& loads);

// The least budget that spends so much on the caches.
std::uint64_t memoryForCaches(const SceneFile& file, const GatherWork& work,
                              std::uint64_t cache_bytes);

// The least budget, in whole MiB, whose plan is good enough; larger ones are, and that of all pages
// in memory is taken to be.
std::uint64_t leastMemoryThat(const SceneFile& file, const GatherWork& work,
                              const std::function<bool(const GatherMemory&)>& is_enough);

// The least budget, in whole MiB, with which loads take no longer than that.
std::uint64_t memoryForLoads(const SceneFile& file, const GatherWork& work,
                             const GatherLoads& loads, double most_load_seconds);

struct MemoryAdvice {
  std::uint64_t memory_bytes = 0;  // would do
  double part_of_time = 0;         // that goes into reading evicted pages again, 0 .. 1
};

// What the monitor of a gather with this plan says, which spent `working_seconds` of all threads
// beside loads. Nothing where its memory is enough.
std::optional<MemoryAdvice> adviseMemory(const SceneFile& file, const GatherMemory& plan,
                                         const GatherLoads& loads, double working_seconds);

}  // namespace surfeit
