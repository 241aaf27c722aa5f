// Sheets above and below that of a place, which gaps tell from it (docs/surfels.md, "Sizes from the
// neighbourhood").
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
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

// Below and above the first gap above the plane; 0: there is none.
struct SheetGap {
  float below = 0, above = 0;
};

// Of heights in ascending order.
inline SheetGap firstGap(const std::vector<float>& heights, float spacing, float thickness) {
  float below = 0;
  for (const float height : heights) {
    const float gap = height - below;
    if (gap > kWideGap * spacing ||
        (gap > kNarrowGap * spacing && gap > kGapOverThickness * thickness)) {
      return {below, height};
    }
    below = height;
  }
  return {};
}

// Drops what lies above (`side` 1) or below (-1) the first gap on that side. What lies only far
// beside the place may belong to a slope: a sheet that goes has something steeply above the place.
// A few places are strays of their surface, not a sheet, unless they `may_be_few`: then all that is
// beyond must be thin beside the gap. Returns the height from which on all went; infinity: none
// did.
inline float dropSheet(float side, float spacing, float thickness, bool may_be_few,
                       std::vector<FlatNeighbour>& flat, std::vector<float>& heights) {
  heights.clear();
  for (const FlatNeighbour& n : flat) {
    if (side * n.above > 0) heights.push_back(side * n.above);
  }
  std::sort(heights.begin(), heights.end());
  const SheetGap gap = firstGap(heights, spacing, thickness);
  const float limit = gap.above;
  if (limit == 0) return std::numeric_limits<float>::infinity();
  const auto is_beyond = [&](const FlatNeighbour& n) { return side * n.above >= limit; };
  const bool is_sheet = std::any_of(flat.begin(), flat.end(), [&](const FlatNeighbour& n) {
    return is_beyond(n) && std::abs(n.above) > kSteep * glm::length(n.beside);
  });
  const auto beyond = std::count_if(flat.begin(), flat.end(), is_beyond);
  const std::ptrdiff_t fewest = std::ptrdiff_t(flat.size()) / 6;
  const bool are_few = std::ptrdiff_t(flat.size()) - beyond < fewest;
  const bool is_clear = limit - gap.below > kGapOverThickness * thickness;
  const bool goes = is_sheet && beyond >= fewest && (!are_few || (may_be_few && is_clear));
  if (!goes) return std::numeric_limits<float>::infinity();
  std::erase_if(flat, is_beyond);
  return limit;
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

// How thick the own sheet is: a quarter of the neighbours lie nearer to the plane. Where the own
// sheet has fewer, half of the others lie between heights that are twice that apart.
inline float thicknessOf(const std::vector<FlatNeighbour>& flat, std::vector<float>& heights) {
  if (flat.empty()) return 0;
  const auto quartile = [&](std::size_t quarters, auto height) {
    heights.clear();
    for (const FlatNeighbour& n : flat) heights.push_back(height(n.above));
    const auto at = heights.begin() + std::ptrdiff_t(heights.size() * quarters / 4);
    std::nth_element(heights.begin(), at, heights.end());
    return *at;
  };
  const auto signed_height = [](float above) { return above; };
  const float half = quartile(1, [](float above) { return std::abs(above); });
  return std::min(half, .5f * (quartile(3, signed_height) - quartile(1, signed_height)));
}

// Root mean square of their heights.
inline float spreadOf(const std::vector<FlatNeighbour>& flat) {
  float sum = 0;
  for (const FlatNeighbour& n : flat) sum += n.above * n.above;
  return flat.empty() ? 0 : std::sqrt(sum / float(flat.size()));
}

// How far above and below other sheets begin.
struct OtherSheets {
  float above = std::numeric_limits<float>::infinity();
  float below = std::numeric_limits<float>::infinity();
};

// Drops what lies on other sheets. Lengths are in any unit; `heights` is scratch.
inline OtherSheets dropOtherSheets(float spacing, bool may_be_few, std::vector<FlatNeighbour>& flat,
                                   std::vector<float>& heights) {
  const SideGaps gaps = gapsIn(flat, kNarrowGap * spacing);
  OtherSheets others;
  if (!gaps.above && !gaps.below) return others;
  const float thickness = thicknessOf(flat, heights);
  if (gaps.above) others.above = dropSheet(1, spacing, thickness, may_be_few, flat, heights);
  if (gaps.below) others.below = dropSheet(-1, spacing, thickness, may_be_few, flat, heights);
  return others;
}

}  // namespace surfeit
