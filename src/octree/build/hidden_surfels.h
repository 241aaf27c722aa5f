// Sheets close behind each other that face alike, a rug and the floor below it: what of one lies
// behind another is marked. Normals do not tell such sheets apart, and distances within a pixel do
// not tell which is in front.
#pragma once

#include <cstddef>
#include <span>

#include "surfeit/surfel.h"

namespace surfeit {

// Cells that are looked at have up to so many surfels. Borders of cells cut sheets apart, so the
// large ones; and bent sheets have no clear gaps, so the small ones, too.
inline constexpr std::size_t kLayerCells[] = {1024, 64};

// Sets kSurfelHiddenFront and kSurfelHiddenBack of those surfels of a cell that another sheet of it
// hides, and leaves all others as they are.
void markHidden(std::span<Surfel> cell);

}  // namespace surfeit
