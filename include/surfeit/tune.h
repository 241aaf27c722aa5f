// Advice on the memory of a gather: predicts cache misses and time for budgets of any size, from a
// sample of its receivers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct TuneOptions {
  // The gather to predict. Its memory_bytes bound the tuning itself, checks included; 0: three
  // quarters of the memory that the job may use. Predictions are for its number of threads.
  GatherOptions gather;
  // Number of receivers whose look-ups are followed; 0: all.
  std::uint64_t sample_receivers = 500'000;
  // Runs the whole gather, and discards its results, in every budget of the table that fits and in
  // the recommended budget.
  bool check = false;
};

// One of the two caches in a gather.
struct TuneCache {
  std::uint64_t frame_bytes = 0;  // memory for its frames; when measured, at the end
  double requests = 0;
  double loads = 0;       // pages read, on request or ahead of it
  double bytes_read = 0;  // stored bytes of these pages

  // Part of the requests that needed no read, 0..1.
  double hitRate() const { return requests > 0 ? 1 - loads / requests : 1; }
};

// Cache use and time of a gather in one budget, predicted or measured.
struct TuneOutcome {
  TuneCache node_cache, surfel_cache;
  double seconds = 0;  // wall time inside the gather proper

  double bytesRead() const { return node_cache.bytes_read + surfel_cache.bytes_read; }
};

struct TuneRow {
  std::uint64_t memory_bytes = 0;  // GatherOptions::memory_bytes
  std::uint64_t cache_bytes = 0;   // part of it for both caches
  TuneOutcome predicted;
  std::optional<TuneOutcome> measured;
};

struct TuneReport {
  std::uint64_t receivers = 0, invalid_receivers = 0;
  std::uint64_t sampled_receivers = 0;  // receivers whose look-ups were followed
  int threads = 0;
  std::uint64_t memory_bytes = 0;         // budget of the tuning
  std::uint64_t decoded_cache_bytes = 0;  // size of caches that hold the whole file
  double sample_seconds = 0;              // wall time of the sampled run

  double receiver_seconds = 0;  // wall time per receiver with all pages in memory
  double node_load_seconds = 0, surfel_load_seconds = 0;  // of one page, from where the file is now

  // The least budget that works, and the budgets with caches for 1, 2, 5, 10, 20, 50 and 100 % of
  // the decoded file, in rising order.
  std::vector<TuneRow> rows;
  // Predictions at many more sizes of the caches, in rising order, for plots.
  std::vector<TuneRow> curve;
  // The budget beyond which more memory saves hardly any read (kKnee* of MissRatioCurve).
  TuneRow knee;
  // The smallest budget whose predicted time is within kTuneTimeMargin of the time with the whole
  // file in memory.
  TuneRow recommended;

  // Mean absolute difference of predicted and measured hit rates over the rows, both caches, in
  // percentage points; absent if no row was measured. The least budget is left out: threads hold
  // nearly all of its few frames, and the prediction does not include their effect on each other.
  std::optional<double> hitRateError() const;
};

inline constexpr double kTuneTimeMargin = 0.05;

// Follows the look-ups of a sample of the receivers through the octree and gathers at some of them.
// From that it predicts a gather at all of `receivers_path`, in budgets of any size. Writes nothing
// but temporary files. With all receivers sampled, the predicted loads are the loads of LRU caches
// for exactly the look-ups of a gather; with fewer they are estimates (docs/tune.md).
// Times depend on how much of the file is in the system's page cache now. Errors: as gatherCloud;
// kCorruption without valid receivers.
SURFEIT_API Result<TuneReport> tuneGather(const std::string& scene_path,
                                          const std::string& receivers_path,
                                          const TuneOptions& options, Progress& progress);

// What a gather in the budget of its options will take, about.
struct GatherForecast {
  std::uint64_t receivers = 0, sampled_receivers = 0;
  int threads = 0;
  std::uint64_t memory_bytes = 0;                                      // the budget
  std::uint64_t least_memory_bytes = 0, recommended_memory_bytes = 0;  // as TuneReport has them
  std::uint64_t temporary_bytes = 0;                                   // at most
  std::uint64_t result_bytes = 0;  // where it is no text and not compressed
  double seconds = 0;              // wall time inside the gather proper
};

// Tunes by a small sample, and reads the row of the report that the budget reaches. Writes nothing
// but temporary files. Errors: as tuneGather.
SURFEIT_API Result<GatherForecast> forecastGather(const std::string& scene_path,
                                                  const std::string& receivers_path,
                                                  const GatherOptions& options, Progress& progress);

}  // namespace surfeit
