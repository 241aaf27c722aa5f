#include "octree/neighbours/leaf_levels.h"

#include <algorithm>

#include "octree/build/curve_cells.h"

namespace surfeit {

void findLeafLevels(std::span<const CurveKey> keys, std::optional<CurveKey> before,
                    std::optional<CurveKey> after, std::size_t capacity,
                    std::span<std::uint8_t> levels) {
  for (std::size_t begin = 0; begin < keys.size();) {
    int boundary_level = before ? firstDifferentLevel(*before, keys[begin]) : 0;
    // A leaf ends before the next page
    if (after && keys.size() - begin <= capacity) {
      boundary_level = std::max(boundary_level, firstDifferentLevel(keys[begin], *after));
    }
    const CurveCell leaf = curveCellAt(keys, begin, keys.size(), boundary_level, capacity);
    std::fill_n(levels.begin() + std::ptrdiff_t(begin), leaf.size, std::uint8_t(leaf.level));
    begin += leaf.size;
    before = keys[begin - 1];
  }
}

}  // namespace surfeit
