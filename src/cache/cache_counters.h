// What a cache has done so far.
#pragma once

#include <cstdint>

namespace surfeit {

// Look-ups for prefetching count in the prefetch fields alone. Times are nanoseconds, summed over
// threads.
struct CacheCounters {
  std::uint64_t requests = 0;        // hits + misses
  std::uint64_t hits = 0;            // front_hits + shared_hits
  std::uint64_t front_hits = 0;      // answered by a thread's own front, or always resident
  std::uint64_t shared_hits = 0;     // found loaded, or being loaded by another thread
  std::uint64_t waits = 0;           // of the shared hits: those that waited for that other thread
  std::uint64_t misses = 0;          // loads started, failed ones included
  std::uint64_t prefetches = 0;      // loads started ahead of any request
  std::uint64_t failed_loads = 0;    // of misses and prefetches
  std::uint64_t repeated_loads = 0;  // of the others: of pages that were loaded before
  std::uint64_t evictions = 0;       // loaded pages given up for others
  std::uint64_t bytes_read = 0;      // stored bytes of the pages loaded
  std::uint64_t repeated_bytes = 0;  // of these: by repeated loads
  std::uint64_t load_ns = 0;         // in the loader: reading, checking, decoding
  std::uint64_t stall_ns = 0;        // threads that did not prefetch waited for loads or frames
  std::uint64_t peak_bytes = 0;      // most frame bytes in use at any time
  std::uint64_t budget_bytes = 0;    // of all frames allowed now
  std::uint64_t decoded_bytes = 0;   // of the frames that would hold every page
};

}  // namespace surfeit
