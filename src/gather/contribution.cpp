#include "gather/contribution.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "gather/coverage_rules.h"

namespace surfeit {
namespace {

// What a side of something flat shows, by the cosine of its front.
float shownCosine(float cosine, GatherSides sides) {
  switch (sides) {
    case GatherSides::kBoth:
      return std::abs(cosine);
    case GatherSides::kBack:
      return std::max(0.f, -cosine);
    case GatherSides::kFront:
      break;
  }
  return std::max(0.f, cosine);
}

}  // namespace

Surfel withSides(const Surfel& surfel, GatherSides sides) {
  if (sides != GatherSides::kBack) return surfel;
  Surfel turned = surfel;
  if (!surfel.isTwoSided()) turned.normal = -surfel.normal;
  turned.radiosity = glm::vec3(0);
  return turned;
}

// With w_i the weights, x_i = d . n_i and T = sum w_i, band by band the expansion is
//
//   s0 = T / 4,   s1 = sum w x / 2,   s2 = (5/32) sum w (3 x^2 - 1),
//
// so the coefficients hold the first two moments of x exactly. What they do not hold is the shape
// of its distribution, and the truncated series guesses badly there: a flat cluster shows 17/16 of
// its area head-on, 3/32 along its edge, -1/25 somewhat behind that and 1/16 from the back. We take
// x as spread evenly over [m - r, m + r] with mean m = sum w x / T and variance r^2 / 3, and get
//
//   T m for m >= r (all face us),   0 for m <= -r (all face away),   T (m + r)^2 / (4 r) between.
//
// That is exact for a single normal (r = 0), for evenly spread ones (m = 0, r = 1), and for
// spheres, whose coefficients are those of four times their weight spread evenly. It is never
// negative, and the sums for d and -d differ by exactly T m, as they must. Two-sided disks of one
// normal come out worst, 0.87 head-on. T m and T r are `mean` and `range` below.
float projectedSum(const ShCoefficients& coefficients, const ShCoefficients& basis,
                   float& opposite) {
  const ShCoefficients& c = coefficients;
  const ShCoefficients& y = basis;
  const float band_1 = c[1] * y[1] + c[2] * y[2] + c[3] * y[3];
  const float band_2 = c[4] * y[4] + c[5] * y[5] + c[6] * y[6] + c[7] * y[7] + c[8] * y[8];
  const float total = 4 * c[0] * y[0];
  const float mean = 2 * band_1;
  const float mean_sq = (total + 6.4f * band_2) / 3;
  const float range = std::sqrt(std::max(0.f, 3 * (total * mean_sq - mean * mean)));

  const float facing = mean >= range    ? mean
                       : mean <= -range ? 0
                                        : (mean + range) * (mean + range) / (4 * range);
  opposite = facing - mean;
  return facing;
}

bool makeContribution(const Node& node, const glm::vec3& to_node, const ContributionRules& rules,
                      Contribution& contribution) {
  const float distance_sq = glm::dot(to_node, to_node);
  const glm::vec3 direction = to_node / std::sqrt(distance_sq);

  // Area that the receiver sees, and what of it sends light
  float area = 0, front_area = 0, overlap = 0;
  glm::vec3 power(0);
  if (node.isFlat()) {
    const float cosine = -node.flatness * glm::dot(direction, node.normal);
    front_area = node.area * std::max(0.f, cosine);
    area = node.area * shownCosine(cosine, rules.sides);
    if (!(area > 0)) return false;
    power = front_area * node.radiosity;
  } else {
    const ShCoefficients basis = shBasis(-direction);
    float back_area;
    front_area = projectedSum(node.coefficients(kAreaKind), basis, back_area);
    switch (rules.sides) {
      case GatherSides::kBoth:
        area = front_area + back_area;
        break;
      case GatherSides::kBack:
        area = back_area;
        overlap = overlapOf(back_area, front_area);
        break;
      case GatherSides::kFront:
        area = front_area;
        overlap = overlapOf(front_area, back_area);
        break;
    }
    if (!(area > kLeastVisiblePart * node.area)) return false;
    if (rules.has_color && rules.sides != GatherSides::kBack) {
      float ignored;
      for (int channel = 0; channel < 3; ++channel) {
        power[channel] = projectedSum(node.coefficients(powerKind(channel)), basis, ignored);
      }
    }
  }

  // However the surfels lie, they show no more than their area, and no more than the outline of the
  // sphere that holds them; what exceeds that hides behind the rest. (Spheres and two-sided surfels
  // count twice in front plus back, which the first limit takes back head-on.)
  const float visible_area = std::min({area, node.area, kPi * node.radius * node.radius});
  contribution.distance_sq = distance_sq;
  contribution.radius = node.radius;
  contribution.direction = direction;
  contribution.solid_angle = visible_area / distance_sq;
  contribution.spread = node.area / distance_sq;
  contribution.overlap = overlap;
  contribution.normal = node.flatness * node.normal;
  contribution.radiosity = rules.has_color ? power / area : glm::vec3(0);
  return contribution.solid_angle > 0;
}

bool makeContribution(const Surfel& surfel, const glm::vec3& to_surfel,
                      const ContributionRules& rules, Contribution& contribution) {
  const float distance_sq = glm::dot(to_surfel, to_surfel);
  if (!(distance_sq > 0)) return false;
  const glm::vec3 direction = to_surfel / std::sqrt(distance_sq);

  // Which side the receiver sees, and how much of it
  const float cosine = surfel.isSphere() ? 1 : -glm::dot(direction, surfel.normal);
  const bool sends_light = cosine > 0 || surfel.isTwoSided();
  if (!sends_light && rules.sides != GatherSides::kBoth) return false;

  contribution.distance_sq = distance_sq;
  contribution.radius = surfel.radius;
  contribution.direction = direction;
  contribution.solid_angle = surfel.area * std::abs(cosine) / distance_sq;
  contribution.spread = surfel.area / distance_sq;
  contribution.overlap = 0;
  contribution.normal = surfel.normal;
  contribution.radiosity = sends_light && rules.has_color ? surfel.radiosity : glm::vec3(0);
  return contribution.solid_angle > 0;
}

}  // namespace surfeit
