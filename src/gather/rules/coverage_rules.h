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

// How far before and behind its middle a contribution meets others of its layer: hardly more than
// it extends, by its variance along the direction, so that tiles of one surface meet whether they
// are seen head-on or aslant, and no rounding decides; and at least a part of its radius. Every
// receiver has its own direction.
struct LayerReach {
  float least = 0;
  float spread_sq = 0;  // its square is this times the spread along the direction (Patch::shape)

  // Of what has a radius and a covariance with this trace: three times the variance.
  static LayerReach of(float radius, float trace) {
    return {kFidelity.least_reach * radius, 1.5f * trace};
  }
  // A sphere is as a disk along the direction.
  static LayerReach ofDisk(float radius) { return of(radius, 0.5f * radius * radius); }
  bool isNone() const { return least == 0 && spread_sq == 0; }
};

// What hides, hides: patches have exact areas, and these scatter around what a pixel of a surface
// holds, so sums alone would let through what lies behind. So a pixel also knows which of its 4 by
// 4 samples lie within the hull, the union of the patches, each widened (docs/algorithm.md,
// "Closing"). Where the hull, narrowed again by as much, holds the pixel, a surface goes on there,
// and what is left open before its layer ends is closed. Holes narrower than twice the widening
// close so; outlines stay where they are, and areas, and with them power, are not touched.
inline constexpr int kHullSide = 4;  // samples along a pixel
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

// Finite and positive, for a surfel may be at a receiver; then it is near at any setting.
inline float nearBorderSq(float near_distance) {
  return std::clamp(near_distance * near_distance, std::numeric_limits<float>::min(),
                    std::numeric_limits<float>::max());
}

// Coverage in the middle of a soft disk, which falls off as 1 - (distance / radius)^2 and is
// limited to 1, such that the whole disk covers `area`, or, where gaps are worse, more.
inline float softDiskPeak(float radius, float area, bool is_exact) {
  const float covered = (is_exact ? 1 : kFidelity.soft_disk_area) * area;
  const float share = std::min(0.95f, covered / (kPi * radius * radius));
  return share < 0.5f ? 2 * share : 1 / (2 * (1 - share));
}

// A node that is seen mostly from behind shows fronts that face each other: folds, bumps and
// leaves, which hide each other instead of lying side by side. Overlap grows from 0 where fronts
// and backs are equal (anything closed) to 1 where backs are 9/5 of the fronts.
// (Fidelity::overlap_gain)
inline float overlapOf(float front_area, float back_area) {
  return std::clamp(kFidelity.overlap_gain * (back_area - front_area) / (back_area + front_area),
                    0.f, 1.f);
}

}  // namespace surfeit
