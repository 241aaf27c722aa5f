// A lobe is a von Mises-Fisher distribution: with the axis a and the concentration k its density is
// f(v) = k / (2 pi (1 - exp(-2 k))) exp(k (a . v - 1)), and r = coth k - 1 / k the length of its
// mean.
#include "gather/rules/lobe_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// The narrowest lobe, k = 2000: that of a roughness of .03.
constexpr float kLongestMean = 0.9995f;
constexpr float kLeastConcentration = 1e-4f;
// Lobes along the surface send most of their light into it. From here on some of that is lost, lest
// single surfels outshine all else.
constexpr float kLeastFacing = 0.02f;

// The inverse of r = coth k - 1 / k within 1.5 % (Banerjee et al. 2005).
float concentrationOf(float r) {
  return std::max(r * (3 - r * r) / (1 - r * r), kLeastConcentration);
}

// And r itself, of the k that is used.
float meanLengthOf(float k) {
  return k < 0.5f ? k / 3 * (1 - k * k / 15) : 1 / std::tanh(k) - 1 / k;
}

// The integral of f(v) max(v . n, 0), for x = a . n. Wide lobes: by bands, of which the clamped
// cosine has 1/4, 1/2, 5/16, 0 and -3/32, and the lobe 1, r, 1 - 3 r / k and about a power of that.
// Narrow ones: v . n is nearly normally distributed, with the variances of f along and across its
// axis.
float facingPart(float k, float x) {
  constexpr float kNarrow = 8;
  const float r = meanLengthOf(k);
  if (k < kNarrow) {
    const float second = k < 0.5f ? k * k / 15 : 1 - 3 * r / k, xx = x * x;
    const float p2 = 0.5f * (3 * xx - 1), p4 = (35 * xx * xx - 30 * xx + 3) / 8;
    return 0.25f + 0.5f * r * x + 5.f / 16 * second * p2 -
           3.f / 32 * std::pow(second, 10.f / 3) * p4;
  }
  const float across = r / k, along = std::max(0.f, 1 - 2 * across - r * r);
  const float deviation = std::sqrt(along * x * x + across * (1 - x * x));
  const float mean = r * x, t = mean / std::max(deviation, 1e-6f);
  constexpr float kRootOf2 = 1.41421356f, kRootOf2Pi = 2.50662827f;
  return deviation * std::exp(-0.5f * t * t) / kRootOf2Pi +
         0.5f * mean * (1 + std::erf(t / kRootOf2));
}

}  // namespace

LobeLight::LobeLight(const Lobe& lobe, const glm::vec3& normal) : shares(lobe.shares()) {
  const glm::vec3 mean = lobe.meanDirection();
  const float length = glm::length(mean);
  axis = length > 0 ? mean / length : normal;
  concentration = concentrationOf(std::min(length, kLongestMean));
  facing = std::max(facingPart(concentration, glm::dot(axis, normal)), kLeastFacing);
}

}  // namespace surfeit
