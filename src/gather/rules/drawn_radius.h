// How large surfels are drawn: disks, and ribbons.
#pragma once

#include <algorithm>

#include "core/ribbon.h"
#include "gather/rules/coverage_rules.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Of the circle that a surfel is drawn within, as the ribbon that it is, if it is one.
inline float drawnRadius(const Surfel& surfel, const Ribbon& ribbon) {
  if (ribbon.isEmpty()) return effectiveRadius(surfel.radius, surfel.area);
  return std::max(surfel.radius, ribbon.radius());
}

}  // namespace surfeit
