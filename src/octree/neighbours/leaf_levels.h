// The leaves that the surfels of a page lie in: their levels in the octree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/curve_key.h"

namespace surfeit {

// `keys`: of a page's surfels, in order; `before` and `after`: of the surfels next to these on other
// pages, if there are any. A leaf has up to `capacity` surfels and lies on one page. Leaves of more
// than a page, and more than `capacity` in a cell of the finest level, get the levels of smaller
// cells.
void findLeafLevels(std::span<const CurveKey> keys, std::optional<CurveKey> before,
                    std::optional<CurveKey> after, std::size_t capacity,
                    std::span<std::uint8_t> levels);

}  // namespace surfeit
