#include "octree/neighbours/leaf_levels.h"

#include <algorithm>

namespace surfeit {

void findLeafLevels(std::span<const CurveKey> keys, std::optional<CurveKey> before,
                    std::optional<CurveKey> after, std::size_t capacity,
                    std::span<std::uint8_t> levels) {
  for (std::size_t begin = 0; begin < keys.size();) {
    // The largest cell without what comes before, and without the first that does not fit
    int level = before ? firstDifferentLevel(*before, keys[begin]) : 0;
    const bool is_last = keys.size() - begin <= capacity;
    const std::optional<CurveKey> next = is_last ? after : keys[begin + capacity];
    if (next) level = std::max(level, firstDifferentLevel(keys[begin], *next));
    level = std::min(level, kCurveLevels);
    do levels[begin++] = std::uint8_t(level);
    while (begin < keys.size() && firstDifferentLevel(keys[begin - 1], keys[begin]) > level);
    before = keys[begin - 1];
  }
}

}  // namespace surfeit
