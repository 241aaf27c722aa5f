// The ranges of the curve that the shards of an index build, and how they are known to begin where
// slabs do.
//
// A range begins with a cell of the octree. Slabs begin anew there (octree/build/slab.h) where the
// cell above it has had kFreshSurfels before. Every shard counts its surfels in these stretches,
// the sums are exact, and ranges between which slabs would go on are built as one.
//
// Where repeated surfels are left out there may be less than a brick of these, and a brick would go
// on. How many are left shows after the build. So more are asked for, and the merge looks again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "core/curve_key.h"
#include "octree/build/slab.h"
#include "surfeit/index.h"

namespace surfeit {

// Surfels that the cell above must have had where a range begins.
std::uint64_t leastBefore(Repeats repeats);

// Keys at which at most `count` ranges of about equal numbers of sample words begin: one less than
// ranges, rising. `surfels` are those that the sample stands for; the words rise. `least` as above.
std::vector<CurveKey> chooseRanges(std::span<const CurveKey> sample, std::uint64_t surfels,
                                   int count, std::uint64_t least);

// What is counted between two neighbouring marks: places where ranges begin, or the cells above
// them.
struct RangeCount {
  std::uint64_t surfels = 0;
  CurveKey least = ~CurveKey{0}, most = 0;

  void add(const RangeCount& other);
};

class RangeCounts {
 public:
  explicit RangeCounts(const std::vector<CurveKey>& splitters);

  // From any thread.
  void add(std::span<const CurveKey> keys);
  // Of another shard: as many as there are here.
  void add(std::span<const RangeCount> counts);

  std::span<const RangeCount> counts() const { return counts_; }

  // Ranges that are built together.
  struct Joined {
    int first = 0, last = 0;  // ranges, from 0 on, both included
    std::uint64_t surfels = 0;
    StreamEnds ends;
  };
  // All of them, in order.
  std::vector<Joined> join(std::uint64_t least) const;
  // Whether the cell above the first one of a range (from 1 on) has had so many surfels before.
  bool hasBefore(std::size_t range, std::uint64_t least) const;

 private:
  RangeCount between(CurveKey begin, CurveKey end) const;

  const std::vector<CurveKey> splitters_;
  std::vector<CurveKey> marks_;     // rising
  std::vector<RangeCount> counts_;  // counts_[i]: keys below marks_[i] and not below the one before
  std::mutex mutex_;                // guards counts_ while surfels are added
};

}  // namespace surfeit
