// Cells of the octree as runs of sorted curve keys.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "core/curve_key.h"

namespace surfeit {

struct CurveCell {
  std::size_t begin, size;
  int level;
};

// The cell that begins at `begin` among the keys up to `end`, the largest with no more than
// `capacity` of them: its level is at least the boundary's, and deep enough to leave out the key
// after the last one that fits. More than that in one cell of the finest level are one.
inline CurveCell curveCellAt(std::span<const CurveKey> keys, std::size_t begin, std::size_t end,
                             int boundary_level, std::size_t capacity) {
  int level = boundary_level;
  std::size_t limit = std::min(end - begin, capacity);
  if (end - begin > capacity) {
    level = std::max(level, firstDifferentLevel(keys[begin], keys[begin + capacity]));
  }
  if (level > kCurveLevels) {
    level = kCurveLevels;
    limit = end - begin;
  }
  std::size_t size = 1;
  while (size < limit && firstDifferentLevel(keys[begin], keys[begin + size]) > level) ++size;
  return {begin, size, level};
}

}  // namespace surfeit
