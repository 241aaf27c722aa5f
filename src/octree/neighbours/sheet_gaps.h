// Sheets above and below that of a place, which gaps tell from it (docs/surfels.md, "Sizes from the
// neighbourhood").
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <vector>

namespace surfeit {

// Sheets are told apart by a gap between them: of half a spacing, or of a fifth where it is four
// times as wide as the own sheet is thick (two scans of one surface lie closer than that).
inline constexpr float kWideGap = 0.5f, kNarrowGap = 0.2f, kGapOverThickness = 4;
// Of a slope from the place to a neighbour that is another sheet's, not its own.
inline constexpr float kSteep = 0.7f;
// A neighbour in the plane: beside the place, and above it.
struct FlatNeighbour {
  glm::vec2 beside;
  float above;
  std::uint32_t index = 0;  // of the neighbour
};

// Drops what lies above (`side` 1) or below (-1) the first gap on that side. What lies only far
// beside the place may belong to a slope: a sheet that goes has something steeply above the place.
inline void dropSheet(float side, float spacing, float thickness, std::vector<FlatNeighbour>& flat,
                      std::vector<float>& heights) {
  heights.clear();
  for (const FlatNeighbour& n : flat) {
    if (side * n.above > 0) heights.push_back(side * n.above);
  }
  std::sort(heights.begin(), heights.end());
  float below = 0, limit = 0;
  for (const float height : heights) {
    const float gap = height - below;
    if (gap > kWideGap * spacing ||
        (gap > kNarrowGap * spacing && gap > kGapOverThickness * thickness)) {
      limit = height;
      break;
    }
    below = height;
  }
  if (limit == 0) return;
  const auto is_beyond = [&](const FlatNeighbour& n) { return side * n.above >= limit; };
  const bool is_sheet = std::any_of(flat.begin(), flat.end(), [&](const FlatNeighbour& n) {
    return is_beyond(n) && std::abs(n.above) > kSteep * glm::length(n.beside);
  });
  const auto beyond = std::count_if(flat.begin(), flat.end(), is_beyond);
  // A few places are strays of their surface, not a sheet
  const std::ptrdiff_t fewest = std::ptrdiff_t(flat.size()) / 6;
  if (is_sheet && beyond >= fewest && std::ptrdiff_t(flat.size()) - beyond >= fewest) {
    std::erase_if(flat, is_beyond);
  }
}

struct SideGaps {
  bool above = false, below = false;
};

// On which sides a gap may lie that is wider than `narrow`: one leaves a free slot of half of that.
inline SideGaps gapsIn(const std::vector<FlatNeighbour>& flat, float narrow) {
  constexpr float kLastSlot = 62;
  std::uint64_t above = 1, below = 1;  // the plane takes the first
  for (const FlatNeighbour& n : flat) {
    const float slot = std::min(std::abs(n.above) * (2 / narrow), kLastSlot);
    const std::uint64_t bit = std::uint64_t{1} << int(slot);
    (n.above > 0 ? above : below) |= bit;
  }
  const auto hasFree = [](std::uint64_t slots) { return (slots & (slots + 1)) != 0; };
  return {hasFree(above), hasFree(below)};
}

// How thick the own sheet is: a quarter of the neighbours lie nearer to the plane.
inline float thicknessOf(const std::vector<FlatNeighbour>& flat, std::vector<float>& heights) {
  heights.clear();
  for (const FlatNeighbour& n : flat) heights.push_back(std::abs(n.above));
  const auto middle = heights.begin() + std::ptrdiff_t(heights.size() / 4);
  std::nth_element(heights.begin(), middle, heights.end());
  return heights.empty() ? 0 : *middle;
}

// Drops what lies on other sheets. Lengths are in any unit; `heights` is scratch.
inline void dropOtherSheets(float spacing, std::vector<FlatNeighbour>& flat,
                            std::vector<float>& heights) {
  const SideGaps gaps = gapsIn(flat, kNarrowGap * spacing);
  if (!gaps.above && !gaps.below) return;
  const float thickness = thicknessOf(flat, heights);
  if (gaps.above) dropSheet(1, spacing, thickness, flat, heights);
  if (gaps.below) dropSheet(-1, spacing, thickness, flat, heights);
}

}  // namespace surfeit
