// Sheets close behind each other that face alike, a rug and the floor below it: what of one lies
// behind another is marked. Normals do not tell such sheets apart, and distances within a pixel do
// not tell which is in front.
#pragma once

#include <cstddef>
#include <span>

#include "surfeit/surfel.h"

namespace surfeit {

// Cells of up to kLayerCell surfels are looked at with what lies around them, for borders of cells
// cut sheets apart. Then cells of up to kBentCell surfels, for large bent sheets have no clear
// gaps.
inline constexpr std::size_t kLayerCell = 1024, kBentCell = 64;
// More surfels than this are in and around a large cell only where they lie on each other, or are
// many times as large as their spacing. Then the cell is looked at alone, for time grows with the
// square.
inline constexpr std::size_t kMostAround = 4 * kLayerCell;

// Sets kSurfelHiddenFront and kSurfelHiddenBack of the surfels of a cell that another sheet hides,
// and leaves all others as they are. The cell has the first `own` surfels; the others lie around
// it.
void markHidden(std::span<Surfel> surfels, std::size_t own);
inline void markHidden(std::span<Surfel> cell) { markHidden(cell, cell.size()); }

}  // namespace surfeit
