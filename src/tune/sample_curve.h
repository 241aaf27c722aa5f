// The miss-ratio curve of a whole gather from look-ups of some of its receivers: docs/tune.md.
#pragma once

#include <cstdint>
#include <vector>

#include "cache/miss_ratio_curve.h"
#include "cache/reuse_distances.h"

namespace surfeit {

// Small caches: misses in stretches of neighbours, of which each begins with empty caches and
// counts once it has warmed up. What a stretch does not see again counts as a miss, so that this is
// right for caches that warmed up and too much for larger ones.
class StretchMisses {
 public:
  // What the look-ups of a stretch added to `distances` between two moments: begin is when it has
  // warmed up. One page in distances.pagesPerSample() is watched in all stretches alike.
  void begin(const ReuseDistances& distances, std::uint64_t requests);
  void end(const ReuseDistances& distances, std::uint64_t requests);

  // Those of other stretches too.
  void add(const StretchMisses& others);

  double requests() const { return requests_; }
  // Misses of a cache with d * pagesPerSample() frames; the last of them for all that are larger.
  double misses(std::size_t d) const;

 private:
  void count(const ReuseDistances& distances, std::uint64_t requests, double sign);
  void grow(std::size_t sizes);

  std::vector<double> misses_;
  double requests_ = 0;
};

// Large caches: the look-ups of single receivers, evenly spread over all.
struct SpreadMisses {
  MissRatioCurve every, second;  // of all of them, and of every second one
  double share = 1;              // of the gather's receivers they are
};

// What a count that grows with the share of the receivers becomes when the share is 1: `every` at
// the share given, `second` at half of it. The curve through both that saturates as first-order
// kinetics of a surface do, D(q) = D1 q / (k + q): species-accumulation curves are extrapolated so
// (Clench, "How to make regional lists of butterflies", 1979).
double extrapolateToAll(double every, double second, double share);

// A curve for a cache of `page_count` pages, of which one of `pages_per_sample` was watched.
MissRatioCurve wholeCurve(const StretchMisses& stretches, const SpreadMisses& spread,
                          std::uint64_t page_count, std::uint32_t pages_per_sample);

}  // namespace surfeit
