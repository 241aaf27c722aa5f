#include "octree/node/radiosity_slope.h"

#include <algorithm>
#include <cmath>

namespace surfeit {

// With x = n - N, whose mean is zero, and the mean square r^2 / 3 along any direction across N, a
// brightness of 1 + slope . x / r times the mean has sum power x = power r slope / 3.
RadiositySlope RadiositySlope::of(const AreaSums& piece) {
  RadiositySlope slope;
  const double length = piece.normalLength() / piece.area;
  const double range_sq = 1.5 * (1 - length * length);
  if (!(range_sq > kLeastRangeSq)) return slope;
  const double scale = 3 / std::sqrt(range_sq) * (127 / double(kMost));
  for (std::size_t i = 0; i < kCodes; ++i) {
    const std::size_t color = i / 3, axis = i % 3;
    const double power = piece.radiosity[color];
    if (!(power > 0)) continue;
    const double aside = piece.power_normal[color][axis] / power - piece.normal[axis] / piece.area;
    slope.codes[i] = std::int8_t(std::clamp(std::round(scale * aside), -127., 127.));
  }
  return slope;
}

}  // namespace surfeit
