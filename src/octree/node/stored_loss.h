// How much surfels differ when they are read back, which bounds of nodes allow for.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "surfeit/surfel.h"

namespace surfeit {

// How much a surfel may differ when it is read back. Radius: as a part of it, half a step of the
// largest shift. Normal: half a step of the octahedral map where it is widest, sqrt(3) times
// sqrt(6) / 65534 radians. docs/format.md, "Columns".
inline constexpr double kRadiusLoss = 0x1p-11, kNormalLoss = 7e-5;
// Positions of surfels and nodes: this part of the smallest radius of a page.
inline constexpr float kPositionTolerance = 1e-3f;

// Position: 1/1000 of the radius, and far from the origin what the nearest float adds, which is no
// more than there is to round.
inline double positionLoss(const Surfel& surfel) {
  const double step = double(kPositionTolerance) * double(surfel.radius);
  const glm::dvec3 size = glm::abs(glm::dvec3(surfel.position));
  return step + std::min(step, (size.x + size.y + size.z) * 0x1p-24);
}

// Radius of a sphere around its position that holds the surfel when it is read back.
inline float radiusWithLoss(const Surfel& surfel) {
  return float((double(surfel.radius) * (1 + kRadiusLoss) + positionLoss(surfel)) * 1.0000001);
}

}  // namespace surfeit
