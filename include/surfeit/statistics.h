// What the two caches of an engine or of a job did.
#pragma once

#include <cstdint>

namespace surfeit {

// What one of the two caches did. Counts, bytes, and seconds summed over threads.
struct GatherCacheStats {
  std::uint64_t requests = 0;        // hits + misses
  std::uint64_t hits = 0;            // front_hits + shared_hits
  std::uint64_t front_hits = 0;      // answered by a thread's own front, or always resident
  std::uint64_t shared_hits = 0;     // found loaded, or being loaded by another thread
  std::uint64_t waits = 0;           // of the shared hits: those that waited for that other thread
  std::uint64_t misses = 0;          // loads that a thread waited for
  std::uint64_t prefetches = 0;      // loads ahead of any request
  std::uint64_t repeated_loads = 0;  // of both: of pages that had been evicted
  std::uint64_t evictions = 0;       // pages given up for others
  std::uint64_t bytes_read = 0, repeated_bytes = 0;  // stored bytes, of all and of repeated loads
  double load_seconds = 0;                           // reading, checking and decoding
  double stall_seconds = 0;                          // gathering threads waited for pages
  std::uint64_t peak_bytes = 0;                      // most bytes of frames in use
  std::uint64_t budget_bytes = 0;                    // frames this cache may fill
  std::uint64_t decoded_bytes = 0;                   // frames that would hold every page
  // Frames with which a tenth of the reads would repeat earlier ones, from sampled reuse distances.
  std::uint64_t working_set_bytes = 0;
};

// The monitor's record of a stretch of time. Counts are those of the window alone; peak_bytes and
// budget_bytes hold at its end. working_set_bytes is what the pages would fill that were looked up
// in the two seconds or so before, by samples; 0 at first (docs/stats.md).
struct GatherWindow {
  double begin_seconds = 0, end_seconds = 0;  // since the gather began
  std::uint64_t receivers = 0;
  std::uint64_t run_receivers = 0;       // neighbours that a thread takes at a time, at its end
  std::uint64_t prefetch_receivers = 0;  // how far ahead pages are read, at its end
  GatherCacheStats node_cache, surfel_cache;
};

}  // namespace surfeit
