// Surfels, facets and flat nodes that are not seen from one side, because another sheet that faces
// alike lies close before them there.
#pragma once

#include <cstdint>

#include "surfeit/surfel.h"

namespace surfeit {

// Roots of the area of a surfel. A sheet that is no farther before it hides it; of others,
// distances tell which is in front.
inline constexpr float kClosestLayers = 5;
// Sheets are told apart by gaps so many times as wide as either is thick.
inline constexpr float kClearGap = 3;

// The sides that are hidden, where a normal points to and where it points away from, as bits.
enum HiddenSides : std::uint8_t { kHiddenFront = 1, kHiddenBack = 2, kHiddenSides = 3 };

inline std::uint8_t hiddenSidesOf(const Surfel& surfel) {
  return static_cast<std::uint8_t>(((surfel.flags & kSurfelHiddenFront) != 0 ? kHiddenFront : 0) |
                                   ((surfel.flags & kSurfelHiddenBack) != 0 ? kHiddenBack : 0));
}
// What they become when the normal is turned round.
inline std::uint8_t turnedSides(std::uint8_t hidden) {
  return static_cast<std::uint8_t>((hidden & kHiddenFront) << 1 | (hidden & kHiddenBack) >> 1);
}

}  // namespace surfeit
