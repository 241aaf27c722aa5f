#include "octree/node/radiosity_slope.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {

// With x = n - N, whose mean is zero, and the mean square r^2 / 3 along any direction across N, a
// brightness of 1 + slope . x / r times the mean has sum power x = power r slope / 3. Spheres and
// two-sided surfels in a flat node face nowhere: their power moves the mean along N alone.
RadiositySlope RadiositySlope::of(const AreaSums& piece) {
  RadiositySlope slope;
  const double length = piece.normalLength() / piece.area;
  const double range_sq = 1.5 * (1 - length * length);
  if (!(range_sq > kLeastRangeSq) || !(length > 0)) return slope;
  const glm::dvec3 mean =
      glm::dvec3(piece.normal[0], piece.normal[1], piece.normal[2]) / piece.area;
  const double scale = 3 / std::sqrt(range_sq) * (127 / double(kMost));
  for (std::size_t color = 0; color < 3; ++color) {
    if (!(piece.radiosity[color] > 0)) continue;
    const auto& sum = piece.power_normal[color];
    const glm::dvec3 bright = glm::dvec3(sum[0], sum[1], sum[2]) / piece.radiosity[color];
    const glm::dvec3 across = bright - glm::dot(bright, mean) / (length * length) * mean;
    for (int axis = 0; axis < 3; ++axis) {
      const double code = std::clamp(std::round(scale * across[axis]), -127., 127.);
      slope.codes[3 * color + std::size_t(axis)] = std::int8_t(code);
    }
  }
  return slope;
}

RadiositySlope RadiositySlope::towards(const glm::vec3& normal, const AreaSums& piece) {
  const RadiositySlope slope = of(piece);
  const glm::dvec3 own(piece.normal[0], piece.normal[1], piece.normal[2]);
  return glm::dot(own, glm::dvec3(normal)) < 0 ? slope.turned() : slope;
}

}  // namespace surfeit
