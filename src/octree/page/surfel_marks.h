// What the builder finds of surfels, and what surfels of a scene that is not finished may lack.
#pragma once

#include <cstdint>

#include "core/long_side.h"
#include "surfeit/surfel.h"

namespace surfeit {

// What the builder finds of a surfel and of those around it.
inline constexpr std::uint16_t kSurfelHiddenSides = kSurfelHiddenFront | kSurfelHiddenBack;
inline constexpr std::uint16_t kSurfelMarks = kSurfelHiddenSides | kSurfelLoose | kSurfelLone;
// Of a node alone: surfels below share pieces, or are tiles (core/long_side.h).
inline constexpr std::uint16_t kNodeShares = 1u << 15, kNodeTiles = 1u << 14;
// A surfel's part of the marks of its leaf.
inline std::uint16_t marksOf(const Surfel& surfel) {
  std::uint16_t marks = surfel.flags & kSurfelMarks;
  if (sharersOf(surfel) > 1) marks |= kNodeShares;
  if (isTile(surfel)) marks |= kNodeTiles;
  return marks;
}

// Marks surfels whose radius and area are to be found, and those whose normal may point to either
// side of their surface (octree/neighbours/orientation.h); never in a finished file.
inline constexpr std::uint32_t kSurfelNeedsSize = 1u << 7, kSurfelNeedsSide = 1u << 6;
// Radius and area of such a surfel meanwhile: positive, because pages hold nothing else.
inline constexpr float kPlaceholderSize = 1e-30f;
// Surfels with a coverage keep their radius and have the coverage times the placeholder as area:
// what is found is the area. Surfels with an area alone keep that.

}  // namespace surfeit
