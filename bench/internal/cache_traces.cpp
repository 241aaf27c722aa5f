#include "bench/internal/cache_traces.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numeric>
#include <random>

#include "cache/reuse_distances.h"

namespace surfeit {
namespace {

// Fewest frames of an LRU cache that hits as often when it sees the look-ups a second time.
std::size_t framesFor(const CacheTrace& trace, double hit_rate) {
  ReuseDistances distances(trace.page_count, trace.page_count);
  const auto watch = [&] {
    for (const PageNumber page : trace.lookups) distances.touch(page);
    return distances.curve(distances.touches());
  };
  const MissRatioCurve once = watch(), twice = watch();
  const double most_misses = (1 - hit_rate) * double(trace.lookups.size());
  std::size_t low = 1, high = trace.page_count;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    const bool is_enough = twice.misses(middle) - once.misses(middle) <= most_misses;
    (is_enough ? high : low) = is_enough ? middle : middle + 1;
  }
  return low;
}

// A quadtree over the unit square, which is what an octree over a surface amounts to. Nodes are
// numbered level by level, and along a Z curve within a level.
class SurfaceTree {
 public:
  static constexpr int kLevels = 10;  // below the root
  static constexpr std::size_t kNodesPerPage = 128;
  static constexpr double kMostAngle = 0.12;  // edge over distance of a node that is in the cut

  static std::size_t levelBegin(int level) { return ((std::size_t{1} << 2 * level) - 1) / 3; }
  static PageNumber pageCount() { return PageNumber(levelBegin(kLevels + 1) / kNodesPerPage + 1); }

  // Appends a page for each range of siblings that the cut of a receiver at (x, y) looks at.
  static void visit(double x, double y, std::vector<PageNumber>& pages) {
    struct Node {
      int level;
      std::uint32_t column, row;
    };
    std::vector<Node> stack = {{0, 0, 0}};
    while (!stack.empty()) {
      const Node node = stack.back();
      stack.pop_back();
      const double edge = std::ldexp(1.0, -node.level);
      const double distance =
          std::hypot((node.column + 0.5) * edge - x, (node.row + 0.5) * edge - y, edge / 4);
      if (edge <= kMostAngle * distance || node.level == kLevels) continue;
      const std::size_t child = 4 * zCurve(node.column, node.row);
      pages.push_back(PageNumber((levelBegin(node.level + 1) + child) / kNodesPerPage));
      for (std::uint32_t i = 4; i-- > 0;) {
        stack.push_back({node.level + 1, 2 * node.column + i % 2, 2 * node.row + i / 2});
      }
    }
  }

 private:
  static std::size_t zCurve(std::uint32_t column, std::uint32_t row) {
    std::size_t index = 0;
    for (int bit = 0; bit < kLevels; ++bit) {
      index |= std::size_t{column >> bit & 1} << 2 * bit;
      index |= std::size_t{row >> bit & 1} << (2 * bit + 1);
    }
    return index;
  }
};

}  // namespace

CacheTrace zipfTrace(PageNumber page_count, std::size_t lookups, double hit_rate) {
  CacheTrace trace{fmt::format("zipf {:g} %", 100 * hit_rate), {}, page_count, 0};
  std::mt19937_64 random(1);
  std::vector<double> sums(page_count);
  double sum = 0;
  for (PageNumber rank = 0; rank < page_count; ++rank) {
    sums[rank] = sum += std::pow(rank + 1.0, -0.99);
  }
  std::vector<PageNumber> page_of_rank(page_count);
  std::iota(page_of_rank.begin(), page_of_rank.end(), 0u);
  std::shuffle(page_of_rank.begin(), page_of_rank.end(), random);
  std::uniform_real_distribution<double> uniform(0, sum);
  trace.lookups.resize(lookups);
  for (PageNumber& page : trace.lookups) {
    const auto rank = std::upper_bound(sums.begin(), sums.end() - 1, uniform(random));
    page = page_of_rank[std::size_t(rank - sums.begin())];
  }
  trace.frames = framesFor(trace, hit_rate);
  return trace;
}

CacheTrace uniformTrace(PageNumber page_count, std::size_t lookups, double hit_rate) {
  CacheTrace trace{fmt::format("uniform {:g} %", 100 * hit_rate), {}, page_count, 0};
  std::mt19937_64 random(2);
  trace.lookups.resize(lookups);
  for (PageNumber& page : trace.lookups) page = PageNumber(random() % page_count);
  trace.frames = framesFor(trace, hit_rate);
  return trace;
}

CacheTrace sweepTrace(PageNumber page_count, std::size_t lookups) {
  CacheTrace trace{"sweep 99.9 %", {}, page_count, 1000};
  std::mt19937_64 random(3);
  trace.lookups.resize(lookups);
  for (std::size_t i = 0; i < lookups; ++i) {
    trace.lookups[i] = PageNumber((i / 1000 + random() % 32) % page_count);
  }
  return trace;
}

CacheTrace octreeTrace(std::size_t lookups) {
  CacheTrace trace{"octree cut", {}, SurfaceTree::pageCount(), SurfaceTree::pageCount() / 40};
  constexpr int kTile = 16, kTiles = 24;
  for (int receiver = 0; trace.lookups.size() < lookups; ++receiver) {
    const int tile = receiver / (kTile * kTile), inside = receiver % (kTile * kTile);
    const int column = tile % kTiles * kTile + inside % kTile;
    const int row = tile / kTiles % kTiles * kTile + inside / kTile;
    SurfaceTree::visit((column + 0.5) / (kTile * kTiles), (row + 0.5) / (kTile * kTiles),
                       trace.lookups);
  }
  trace.lookups.resize(lookups);
  return trace;
}

Result<CacheTrace> recordedTrace(const std::string& path, std::size_t most_lookups) {
  const auto close = [](std::FILE* file) { std::fclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> file(std::fopen(path.c_str(), "rb"), close);
  if (file == nullptr) return Status::ioError(fmt::format("{}: cannot be opened", path));
  CacheTrace trace{"recorded gather", {}, 0, 0};
  unsigned char bytes[4];
  std::size_t size = 0;
  while (trace.lookups.size() < most_lookups && (size = std::fread(bytes, 1, 4, file.get())) == 4) {
    trace.lookups.push_back(PageNumber{bytes[0]} | PageNumber{bytes[1]} << 8 |
                            PageNumber{bytes[2]} << 16 | PageNumber{bytes[3]} << 24);
  }
  if (std::ferror(file.get()) != 0) return Status::ioError(fmt::format("{}: cannot be read", path));
  if (trace.lookups.empty() || (size != 4 && size != 0)) {
    return Status::corruption(fmt::format("{}: expected page numbers of 4 bytes, found {}", path,
                                          trace.lookups.empty() ? "none" : "a part of one"));
  }
  constexpr PageNumber kMostPages = 1 << 24;
  trace.page_count = *std::max_element(trace.lookups.begin(), trace.lookups.end());
  if (trace.page_count >= kMostPages) {
    return Status::corruption(
        fmt::format("{}: page {}, expected less than {}", path, trace.page_count, kMostPages));
  }
  ++trace.page_count;
  trace.frames = std::max<std::size_t>(64, trace.page_count / 50);
  return trace;
}

}  // namespace surfeit
