#include "gather/rules/contribution.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "gather/rules/coverage_rules.h"
#include "gather/rules/fidelity.h"
#include "gather/rules/ribbon.h"

namespace surfeit {
float shownArea(const FacingAreas& facing, GatherSides sides) {
  switch (sides) {
    case GatherSides::kBoth:
      return facing.front + facing.back;
    case GatherSides::kBack:
      return facing.back;
    case GatherSides::kFront:
      break;
  }
  return facing.front;
}

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

// Two moments of x say little about E |x|, of which front plus back is made: three faces of a box
// may show 1/3 or 0.58 of its area. Four moments bound it closely: with y = x^2, E y = s and E y^2
// = q, the least E sqrt(y) has all y that are not 0 alike, at q / s, and the greatest has some at 1
// and the rest alike (the principal representations of Chebyshev and Markov). Evenly spread normals
// lie at 0.64 of the way, and so nearly everything does. (Against the surfels below the rough nodes
// of a cut in Sponza, by a probe that was not kept: areas 0.3 % too large and off by 2.4 % in the
// mean, where `projectedSum` gives 7.7 % too little and is off by 10.8 %.)
FacingAreas facingAreas(float total, float mean, float second, float fourth) {
  constexpr float kTiny = 1e-9f;
  const float inverse = 1 / total;
  const float p2 = second * inverse, p4 = fourth * inverse;
  const float m = mean * inverse, s = std::clamp((1 + 2 * p2) / 3, 0.f, 1.f);
  const float q = std::clamp((7 + 20 * p2 + 8 * p4) / 35, s * s, s);
  const float least = s * std::sqrt(s / std::max(q, kTiny));
  const float at_one = (q - s * s) / std::max(1 - 2 * s + q, kTiny);
  const float rest_sq = (s - q) / std::max(1 - s, kTiny);
  const float greatest = at_one + (1 - at_one) * std::sqrt(rest_sq);
  const float both = std::max(std::abs(m), least + kFidelity.upwards * (greatest - least));
  return {0.5f * total * (both + m), 0.5f * total * (both - m)};
}

// By bands, as in projectedSum: sum w P2(x) = 3.2 s2, and sum w P4(x) is what the node has.
FacingAreas facingAreas(const Node& node, const glm::vec3& to_receiver) {
  const ShCoefficients y = shBasis(to_receiver), c = node.rough.coefficients(kAreaKind);
  const float total = 4 * c[0] * y[0];
  const float mean = 2 * (c[1] * y[1] + c[2] * y[2] + c[3] * y[3]);
  const float second = 3.2f * (c[4] * y[4] + c[5] * y[5] + c[6] * y[6] + c[7] * y[7] + c[8] * y[8]);
  const float fourth = shEvaluate(node.rough.area_band_4, shBand4(to_receiver));
  return facingAreas(total, mean, second, fourth);
}

// The normals n_i of what curves a little have a mean shorter than 1. Their variance 1 - |n|^2 lies
// in the two directions across it, half in each; x = d . n_i spread evenly over [m - r, m + r] has
// the variance r^2 / 3.
float normalRange(const glm::vec3& normal) {
  return std::sqrt(std::max(0.f, 1.5f * (1 - glm::dot(normal, normal))));
}

// As projectedSum: at the rim of a curved thing, a part of a piece faces the receiver whose mean
// normal does not. (Without it, AO RMSE and bias of the bunny on a plane .0047 and -.0038, instead
// of .0037 and -.0020.)
FacingAreas facingAreas(const Facet& facet, const glm::vec3& to_receiver) {
  const float m = glm::dot(facet.normal, to_receiver), range = normalRange(facet.normal);
  float front = std::max(m, 0.f);
  if (std::abs(m) < range) front = (m + range) * (m + range) / (4 * range);
  return {facet.area * front, facet.area * (front - m)};
}

Facet facetOf(const Node& node) {
  return {node.position,  node.radius,     node.flatness * node.normal, node.area,
          node.radiosity, node.covariance, node.isTwoSided(),           false};
}

// Over the surfels i of a node, with w_i = A_i n_i . v for the direction v towards the receiver,
// the front moment F times v is the sum of (x_i - c) w_i: what faces the receiver, less what turns
// away. With m and -m the offsets of the middles of either, as in anything symmetric, that is
// (front + back) m; and when all of it faces the receiver, it is front m. So m is exact for a
// sphere (two thirds of its radius towards the receiver), for an edge of which one face shows, and
// for a cap.
//
// From a finite distance D the surfels turn: of the solid angles A_i n_i . (D v - x_i) / |D v -
// x_i|^3 the sum is front / D^2 (1 + (3 m . v - q) / D) to first order, with q the mean of n_i .
// x_i, which the trace of F gives like m. In the distance of m it looks 1 + 2 m . v / D as large,
// and the rest is `perspective`: of a sphere, whose rim is behind its middle, the same less.
SeenPart seenPart(const Node& node, const glm::vec3& to_node, const FacingAreas& facing,
                  GatherSides sides) {
  const float both = facing.front + facing.back, distance = glm::length(to_node);
  const glm::vec3 v = -to_node / distance;
  const auto& moment = node.rough.front_moment;
  const glm::vec3 weighted(glm::dot(moment[0], v), glm::dot(moment[1], v), glm::dot(moment[2], v));
  const float trace = moment[0].x + moment[1].y + moment[2].z;
  float part = 1 / both;
  if (sides == GatherSides::kBack) part = -part;
  if (sides == GatherSides::kBoth) part *= (facing.front - facing.back) / both;

  glm::vec3 middle = part * weighted;
  const float length = glm::length(middle);
  if (length > node.radius) middle *= node.radius / length;
  const float turn = part * (glm::dot(v, weighted) - trace) / distance;
  return {middle, 1 + std::clamp(turn, -kFidelity.most_turn, kFidelity.most_turn)};
}

namespace {
// Four times band 0, over the area: 1 of one-sided disks, 2 of two-sided ones, 4 of spheres.
float partsOfBand0(const Node& node) {
  return 4 * kShY00 * node.rough.sh[0][kAreaKind] / node.area;
}
// How much of a rough node is spheres, 0..1, when the rest is two-sided; one-sided disks count for
// less.
float spherePart(const Node& node) { return std::clamp(0.5f * (partsOfBand0(node) - 2), 0.f, 1.f); }

// The ellipse that spreads as the node does, projected along the direction. The covariance is
// stored in steps of 1/255 of its trace: that much is added, lest a thin wire has no outline.
float ellipseArea(const Node& node, const glm::vec3& direction) {
  constexpr float kStep = 1.f / 255;
  SymmetricMatrix spread = node.covariance;
  for (std::size_t i = 0; i < 3; ++i) spread.entries[i] += kStep * node.covariance.trace();
  const float determinant = quadraticForm(adjugate(spread), direction);
  return 4 * kPi * std::sqrt(std::max(0.f, determinant));
}
}  // namespace

// A surface covers no more than the outline of the sphere that holds all disks, and than a part of
// its ellipse: what exceeds that hides behind the rest. (Spheres and two-sided surfels count twice
// in front plus back, which the limit of the area takes back head-on.)
RoughCover roughCover(const Node& node, const glm::vec3& direction, float shown, float thicket) {
  const float ellipse = ellipseArea(node, direction), sphere = kPi * node.radius * node.radius;
  const float filled = kFidelity.filled_outline + spherePart(node) * (1 - kFidelity.filled_outline);
  const float most = std::min({node.area, sphere, filled * ellipse});
  const float surface = std::min(shown, most);
  const float outline = std::min(sphere, kFidelity.thicket_outline * ellipse);
  if (!(thicket > 0 && outline > 0)) return {surface, 1, most};
  const float hidden = outline * thicketOpacity(std::min(shown, node.area), outline);
  const float area = surface + thicket * (outline - surface);
  return {area, (surface + thicket * (hidden - surface)) / area, std::max(area, most)};
}

float mostVisibleArea(const Facet& facet) {
  return std::min(facet.area, kPi * facet.radius * facet.radius);
}

float reachOf(const Facet& facet, const glm::vec3& direction) {
  const float reach = layerReach(facet.radius, quadraticForm(facet.covariance, direction));
  return facet.is_thicket ? kFidelity.thicket_reach * reach : reach;
}

float thicketPart(const Surfel& surfel) {
  if (!surfel.isTwoSided()) return 0;
  const bool is_ribbon = surfel.long_side != kNoLongSide
                             ? elongationOf(surfel) > kFidelity.ribbon_elongation
                             : looksLikeRibbon(surfel.radius, surfel.area);
  return is_ribbon ? 1 : 0;
}

float reachOf(const Surfel& surfel, const Ribbon& ribbon, float radius,
              const glm::vec3& direction) {
  const bool is_thicket = thicketPart(surfel) > 0;
  if (is_thicket && !ribbon.isEmpty()) {
    return kFidelity.ribbon_reach * ribbon.halfExtent(direction) +
           kFidelity.ribbon_depth * ribbon.width;
  }
  const float reach = layerReachOfDisk(radius, glm::dot(direction, surfel.normal));
  return is_thicket ? kFidelity.thicket_reach * reach : reach;
}

float nestedPart(const Surfel& surfel, const Ribbon& ribbon, const ContributionRules& rules) {
  const float thicket = thicketPart(surfel);
  if (thicket > 0 && !ribbon.isEmpty()) return rules.ribbon_nested;
  return nestedPart(mayTile(surfel), thicket);
}

// Spheres are a surface. Codes round: what is about none is none.
float thicketPart(const Node& node) {
  constexpr float kNone = 0.05f;
  const float more = partsOfBand0(node) - 1;
  const float part = std::min(more, 0.5f * (3 - more));
  return std::clamp((part - kNone) / (1 - 2 * kNone), 0.f, 1.f);
}

SymmetricMatrix shapeOf(const SymmetricMatrix& covariance) {
  const float trace = covariance.trace();
  // Of the smallest surfels it may be zero
  if (!(trace >= std::numeric_limits<float>::min())) return withoutDirection(glm::vec3(0));
  return (2 / trace) * covariance;
}

// The radiosity of what faces `to_receiver`: power over area by the same rule, and what that rule
// sees nearly nothing of sends the mean.
glm::vec3 seenRadiosity(const Node& node, const glm::vec3& to_receiver) {
  const ShCoefficients basis = shBasis(to_receiver);
  float ignored;
  const float area = projectedSum(node.rough.coefficients(kAreaKind), basis, ignored);
  if (!(area > kFidelity.least_visible_part * node.area)) return node.radiosity;
  glm::vec3 power;
  for (int channel = 0; channel < 3; ++channel) {
    power[channel] = projectedSum(node.rough.coefficients(powerKind(channel)), basis, ignored);
  }
  return power / area;
}

bool makeContribution(const Facet& facet, const glm::vec3& to_facet, const ContributionRules& rules,
                      Contribution& contribution) {
  const float distance_sq = glm::dot(to_facet, to_facet);
  if (!(distance_sq > 0)) return false;
  const glm::vec3 direction = to_facet / std::sqrt(distance_sq);
  const FacingAreas facing = facingAreas(facet, -direction);
  const float area = shownArea(facing, facet.is_two_sided ? GatherSides::kBoth : rules.sides);
  if (!(area > 0)) return false;

  contribution.distance_sq = distance_sq;
  contribution.reach = reachOf(facet, direction);
  contribution.direction = direction;
  contribution.solid_angle = std::min(area, mostVisibleArea(facet)) / distance_sq;
  contribution.spread = facet.area / distance_sq;
  contribution.overlap = contribution.thicket = facet.is_thicket ? 1 : 0;
  contribution.opacity = 1;
  contribution.nested = nestedPart(!facet.is_two_sided, contribution.thicket);
  contribution.is_solid = 1;
  contribution.normal = facet.normal;
  contribution.shape = shapeOf(facet.covariance);
  contribution.radiosity = glm::vec3(0);
  if (rules.has_color && rules.sides != GatherSides::kBack) {
    contribution.radiosity =
        facet.is_two_sided ? facet.radiosity : (facing.front / area) * facet.radiosity;
  }
  return contribution.solid_angle > 0;
}

bool makeContribution(const Node& node, const glm::vec3& to_node, const ContributionRules& rules,
                      Contribution& contribution) {
  if (node.isFlat()) return makeContribution(facetOf(node), to_node, rules, contribution);

  // Area that the receiver sees, and the radiosity of what of it sends light
  const glm::vec3 direction = glm::normalize(to_node);
  const FacingAreas facing = facingAreas(node, -direction);
  const float area = shownArea(facing, rules.sides);
  if (!(area > kFidelity.least_visible_part * node.area)) return false;
  const SeenPart seen = seenPart(node, to_node, facing, rules.sides);
  const glm::vec3 to_seen = to_node + seen.middle;
  const float distance_sq = glm::dot(to_seen, to_seen);
  if (!(distance_sq > 0)) return false;

  contribution.thicket = thicketPart(node);
  const RoughCover cover =
      roughCover(node, direction, seen.perspective * area, contribution.thicket);
  contribution.distance_sq = distance_sq;
  contribution.reach = layerReach(node.radius, quadraticForm(node.covariance, direction));
  contribution.direction = to_seen / std::sqrt(distance_sq);
  contribution.solid_angle = cover.area / distance_sq;
  contribution.opacity = cover.opacity;
  contribution.nested = nestedPart(false, contribution.thicket);
  contribution.spread = cover.area / distance_sq;
  contribution.overlap = 0;
  if (rules.sides == GatherSides::kFront) {
    contribution.overlap = overlapOf(facing.front, facing.back);
  } else if (rules.sides == GatherSides::kBack) {
    contribution.overlap = overlapOf(facing.back, facing.front);
  }
  contribution.overlap = std::max(contribution.overlap, contribution.thicket);
  contribution.is_solid = 0;
  contribution.normal = node.flatness * node.normal;
  contribution.shape = shapeOf(node.covariance);
  contribution.radiosity = glm::vec3(0);
  if (rules.has_color && rules.sides != GatherSides::kBack) {
    contribution.radiosity = (facing.front / area) * seenRadiosity(node, -direction);
  }
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
  const Ribbon ribbon = Ribbon::of(surfel);
  contribution.reach = reachOf(surfel, ribbon, surfel.radius, direction);
  contribution.direction = direction;
  contribution.solid_angle = surfel.area * std::abs(cosine) / distance_sq;
  contribution.spread = surfel.area / distance_sq;
  contribution.overlap = 0;
  contribution.thicket = thicketPart(surfel);
  contribution.opacity = 1;
  contribution.nested = nestedPart(surfel, ribbon, rules);
  contribution.is_solid = mayTile(surfel) ? 1 : 0;
  contribution.normal = surfel.normal;
  contribution.shape = ribbon.isEmpty() ? withoutDirection(surfel.normal) : ribbon.shape();
  contribution.radiosity = sends_light && rules.has_color ? surfel.radiosity : glm::vec3(0);
  return contribution.solid_angle > 0;
}

}  // namespace surfeit
