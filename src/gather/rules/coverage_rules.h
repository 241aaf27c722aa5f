// Formulas that say how contributions cover pixels; docs/algorithm.md, "Coverage" and "The raster
// cube", tells their use, and fidelity.h the reasons of their numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/spherical_harmonics.h"
#include "gather/rules/fidelity.h"

namespace surfeit {

// The samples of a pixel for its hull (docs/algorithm.md, "Closing").
inline constexpr int kHullSide = 4;  // along a pixel
inline constexpr std::uint32_t kHullSamples = 0xffff;

// What so many pieces, of this area together, hide of an outline, spread in it at random: all that
// one covers, and of many as Beer and Lambert say.
inline float thicketOpacity(float area, float outline, float pieces) {
  return 1 - std::pow(1 - std::min(1.f, area / (outline * pieces)), pieces);
}

// What so many layers of this opacity hide together where each covers all; `depth` below 1: one.
inline float layersOpacity(float opacity, float depth) {
  return opacity < 1 ? 1 - std::pow(1 - opacity, std::max(1.f, depth)) : 1;
}

// Whether a disk is not even filled by all that may close gaps: it covers a part of its place, as a
// splat does, or a leaf.
inline bool coversInPart(float radius, float area) {
  return kFidelity.soft_disk_area * area < kPi * radius * radius;
}

// Coverage in the middle of a soft disk, which falls off as 1 - (distance / radius)^2 and is
// limited to 1, such that the whole disk covers `area`, or, where gaps are worse, more.
inline float softDiskPeak(float radius, float area, bool is_exact) {
  const float covered = (is_exact ? 1 : kFidelity.soft_disk_area) * area;
  const float share = std::min(0.95f, covered / (kPi * radius * radius));
  return share < 0.5f ? 2 * share : 1 / (2 * (1 - share));
}

// The area that a soft disk of such a peak covers.
inline float softDiskArea(float radius, float peak) {
  return kPi * radius * radius * (peak < 1 ? peak / 2 : 1 - 1 / (2 * peak));
}

}  // namespace surfeit
