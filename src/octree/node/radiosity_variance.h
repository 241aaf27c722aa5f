// How differently the surfels shine that a node is drawn of in one color, and how pages store it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "octree/node/area_sums.h"

namespace surfeit {

// The variance of the radiosity within the pieces of a node, over the square of their means; by
// area times opacity, over all colors. 0: each piece shines evenly, or not at all.
class RadiosityVariance {
 public:
  // Of a node that is one piece.
  static float of(const AreaSums& all) {
    RadiosityVariance variance;
    variance.add(all);
    return float(variance.value());
  }
  void add(const AreaSums& piece) {
    squares_ += piece.radiosity_sq;
    for (int c = 0; c < 3; ++c) {
      if (!(piece.covered[c] > 0)) continue;
      squares_of_means_ += piece.radiosity[c] * (piece.radiosity[c] / piece.covered[c]);
    }
  }
  double value() const {
    return squares_of_means_ > 0 ? std::max(0.0, squares_ / squares_of_means_ - 1) : 0;
  }

 private:
  double squares_ = 0, squares_of_means_ = 0;
};

// As a byte c: 2^(c / 16) - 1, which is 62,760 at most. NaN becomes 0.
inline std::uint8_t varianceCode(float variance) {
  return variance > 0 ? std::uint8_t(std::min(255.f, 16 * std::log2(1 + variance) + 0.5f)) : 0;
}
inline float varianceOf(std::uint8_t code) {
  return code == 0 ? 0 : std::exp2(float(code) * (1.f / 16)) - 1;
}

}  // namespace surfeit
