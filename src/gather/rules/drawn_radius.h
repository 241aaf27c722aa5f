// How large surfels are drawn, and how near they are ray traced: disks, and ribbons.
#pragma once

#include <algorithm>

#include "core/ribbon.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/fidelity.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Of the circle that a surfel is drawn within, as the ribbon that it is, if it is one.
inline float drawnRadius(const Surfel& surfel, const Ribbon& ribbon) {
  if (ribbon.isEmpty()) return effectiveRadius(surfel.radius, surfel.area);
  return std::max(surfel.radius, ribbon.radius());
}

// Closer than this, for each radius of the near field, it is ray traced.
inline float nearFieldSize(float drawn_radius, const Ribbon& ribbon) {
  return ribbon.isEmpty() ? drawn_radius : kFidelity.ribbon_radius * ribbon.length;
}

}  // namespace surfeit
