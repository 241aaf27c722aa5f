// Advice on the memory of a gather: how its caches would do in budgets of any size, found out from
// a sample of its receivers.
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
  // What is to be gathered. Its memory_bytes bound the tuning itself, checks included; 0: three
  // quarters of what the job may use. Its threads are those that predictions are for.
  GatherOptions gather;
  // Receivers whose look-ups are followed; 0: all.
  std::uint64_t sample_receivers = 500'000;
  // Runs the whole gather, throwing its results away, in every budget of the table that fits, and
  // in the one recommended.
  bool check = false;
};

// What one of the two caches does in a gather.
struct TuneCache {
  std::uint64_t frame_bytes = 0;  // of its memory; when measured, at the end
  double requests = 0;
  double loads = 0;       // pages read, by request or ahead of any
  double bytes_read = 0;  // stored bytes of these

  // Share of the requests that took no reading, 0..1.
  double hitRate() const { return requests > 0 ? 1 - loads / requests : 1; }
};

// What a gather in some budget does, predicted or measured.
struct TuneOutcome {
  TuneCache node_cache, surfel_cache;
  double seconds = 0;  // wall time inside the gather proper

  double bytesRead() const { return node_cache.bytes_read + surfel_cache.bytes_read; }
};

struct TuneRow {
  std::uint64_t memory_bytes = 0;  // GatherOptions::memory_bytes
  std::uint64_t cache_bytes = 0;   // of these, for both caches
  TuneOutcome predicted;
  std::optional<TuneOutcome> measured;
};

struct TuneReport {
  std::uint64_t receivers = 0, invalid_receivers = 0;
  std::uint64_t sampled_receivers = 0;  // their look-ups were followed
  int threads = 0;
  std::uint64_t memory_bytes = 0;         // of the tuning
  std::uint64_t decoded_cache_bytes = 0;  // caches that would hold the whole file
  double sample_seconds = 0;              // wall time of the sampled run

  double receiver_seconds = 0;  // wall time per receiver with all pages in memory
  double node_load_seconds = 0, surfel_load_seconds = 0;  // of one page, from where the file is now

  // The least budget that works, and those with caches for 1, 2, 5, 10, 20, 50 and 100 % of the
  // decoded file, in rising order.
  std::vector<TuneRow> rows;
  // Predictions at many more sizes of the caches, in rising order, for plots.
  std::vector<TuneRow> curve;
  // Beyond it, more memory saves hardly any read (kKnee* of MissRatioCurve).
  TuneRow knee;
  // The smallest budget whose predicted time is within kTuneTimeMargin of that with all in memory.
  TuneRow recommended;

  // Mean absolute difference of predicted and measured hit rates over the rows, both caches, in
  // percentage points; nothing unless some row was measured. The least budget is left out: nearly
  // all of its few frames are held by threads, and what they do to each other is not predicted.
  std::optional<double> hitRateError() const;
};

inline constexpr double kTuneTimeMargin = 0.05;

// Follows the look-ups of a sample of the receivers through the octree, gathers at some of them,
// and predicts from that what a gather at all of `receivers_path` would do in budgets of any
// size. Writes nothing but temporary files. With all receivers sampled, the predicted loads are
// those of LRU caches on the very look-ups of a gather; with fewer they are estimates:
// docs/algorithm.md, "Predicting misses from a sample". Times hold for the state of the system's
// page cache as it is. Errors: as gatherCloud; kCorruption without valid receivers.
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
