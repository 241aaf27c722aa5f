// Statistics of the two caches of an engine or of a job.
#pragma once

#include <cstdint>

namespace surfeit {

// Statistics of one cache: counts, bytes, and seconds summed over threads.
struct GatherCacheStats {
  std::uint64_t requests = 0;        // hits + misses
  std::uint64_t hits = 0;            // front_hits + shared_hits
  std::uint64_t front_hits = 0;      // answered by a thread's own front, or always resident
  std::uint64_t shared_hits = 0;     // found loaded, or being loaded by another thread
  std::uint64_t waits = 0;           // shared hits that waited for another thread's load
  std::uint64_t misses = 0;          // loads that a thread waited for
  std::uint64_t prefetches = 0;      // loads ahead of any request
  std::uint64_t repeated_loads = 0;  // misses and prefetches of pages that had been evicted
  std::uint64_t evictions = 0;       // pages removed to make room for others
  std::uint64_t bytes_read = 0, repeated_bytes = 0;  // stored bytes of all and of repeated loads
  double load_seconds = 0;                           // reading, checking and decoding
  double stall_seconds = 0;                          // gathering threads waited for pages
  std::uint64_t peak_bytes = 0;                      // most bytes of frames in use
  std::uint64_t budget_bytes = 0;                    // frames this cache may fill
  std::uint64_t decoded_bytes = 0;                   // frames that would hold every page
  // Bytes of frames with which a tenth of the reads would be repeated ones, from sampled reuse
  // distances.
  std::uint64_t working_set_bytes = 0;
};

// The monitor's record of a time window. Counts are of the window alone; peak_bytes and
// budget_bytes are the values at its end. working_set_bytes is the size of the pages looked up in
// about the last two seconds, estimated from samples; 0 at first (docs/stats.md).
struct GatherWindow {
  double begin_seconds = 0, end_seconds = 0;  // since the gather began
  std::uint64_t receivers = 0;
  std::uint64_t run_receivers = 0;       // neighbours that a thread takes at a time, at the end
  std::uint64_t prefetch_receivers = 0;  // receivers that pages are read ahead for, at the end
  GatherCacheStats node_cache, surfel_cache;
};

}  // namespace surfeit
