// Access orders to try caches on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cache/page_number.h"
#include "surfeit/status.h"

namespace surfeit {

// Look-ups in order, and the size of the caches that are to serve them.
struct CacheTrace {
  std::string name;
  std::vector<PageNumber> lookups;
  PageNumber page_count = 0;
  std::size_t frames = 0;
};

// Zipf's law with exponent 0.99 over shuffled page numbers; all pages alike; a window of 32 pages
// that moves on by one page every thousand look-ups. `hit_rate` is that of an LRU cache which has
// seen the trace before; frames are chosen for it. The sweep, whose rate lies in the trace itself,
// gets 1000 frames.
CacheTrace zipfTrace(PageNumber page_count, std::size_t lookups, double hit_rate);
CacheTrace uniformTrace(PageNumber page_count, std::size_t lookups, double hit_rate);
CacheTrace sweepTrace(PageNumber page_count, std::size_t lookups);

// The node pages of an octree over a surface, in level order with 128 nodes to a page, as gathers
// meet them whose receivers go over the surface in tiles of 16 x 16. Frames: 2.5 % of the pages.
CacheTrace octreeTrace(std::size_t lookups);

// Page numbers recorded by a gather: 32 bits each, little-endian, and nothing else. Frames: 2 % of
// the pages up to the highest number, at least 64. kIoError when the file cannot be read, and
// kCorruption when it holds no such numbers.
Result<CacheTrace> recordedTrace(const std::string& path, std::size_t most_lookups);

}  // namespace surfeit
