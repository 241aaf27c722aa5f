#include "gather/rules/contribution.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "core/ribbon.h"
#include "gather/rules/coverage_rules.h"
#include "gather/rules/fidelity.h"

namespace surfeit {
namespace {
// Four times band 0, over the area: 1 of one-sided disks, 2 of two-sided ones, 4 of spheres.
float partsOfBand0(const Node& node) {
  return 4 * kShY00 * node.rough.sh[0][kAreaKind] / node.area;
}
}  // namespace

float partWithoutSides(const Node& node) { return std::clamp(partsOfBand0(node) - 1, 0.f, 1.f); }

float shownArea(const Node& node, const FacingAreas& facing, GatherSides sides) {
  switch (sides) {
    case GatherSides::kBoth:
      // Two-sided surfels and spheres are in the front and in the back
      return (facing.front + facing.back) / (1 + partWithoutSides(node));
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

// Two moments of x say little about E |x|: three faces of a box may show 1/3 or 0.58 of its area.
// Four bound it closely (docs/algorithm.md, "Contributions").
FacingAreas facingAreas(float total, float mean, float second, float fourth) {
  constexpr float kTiny = 1e-9f;
  // With s = 1/3, q = 1/5 and E |x| = 1/2 of evenly spread normals
  constexpr float kUpwards = 0.64f;
  const float inverse = 1 / total;
  const float p2 = second * inverse, p4 = fourth * inverse;
  const float m = mean * inverse, s = std::clamp((1 + 2 * p2) / 3, 0.f, 1.f);
  const float q = std::clamp((7 + 20 * p2 + 8 * p4) / 35, s * s, s);
  const float least = s * std::sqrt(s / std::max(q, kTiny));
  const float at_one = (q - s * s) / std::max(1 - 2 * s + q, kTiny);
  const float rest_sq = (s - q) / std::max(1 - s, kTiny);
  const float greatest = at_one + (1 - at_one) * std::sqrt(rest_sq);
  const float both = std::max(std::abs(m), least + kUpwards * (greatest - least));
  return {0.5f * total * (both + m), 0.5f * total * (both - m)};
}

Facet facetOf(const Node& node) {
  return {.position = node.position,
          .radius = std::sqrt(3 * node.covariance.trace()),
          .normal = node.flatness * node.normal,
          .area = node.area,
          .radiosity = node.radiosity,
          .covariance = node.covariance,
          .is_two_sided = node.isTwoSided(),
          .is_thicket = node.isTwoSided() && node.isLoose(),
          .opacity = {node.opacity(0), node.opacity(1), node.opacity(2)}};
}

// docs/algorithm.md, "Contributions".
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
  return {middle, 1 + std::clamp(turn, -1.f, 1.f)};  // first order, but no less than nothing
}

namespace {
// The ellipse of what has this covariance, projected along the direction.
float ellipseArea(const SymmetricMatrix& covariance, const glm::vec3& direction) {
  return 4 * kPi * std::sqrt(std::max(0.f, quadraticForm(adjugate(covariance), direction)));
}

// The covariance is stored in steps of 1/255 of its trace: that much is added, lest a thin wire has
// no outline.
float ellipseArea(const Node& node, const glm::vec3& direction) {
  constexpr float kStep = 1.f / 255;
  SymmetricMatrix spread = node.covariance;
  for (std::size_t i = 0; i < 3; ++i) spread.entries[i] += kStep * node.covariance.trace();
  return ellipseArea(spread, direction);
}

// The area of a facet over that of the ellipse that spreads as it does: 3 / pi of a rectangle, less
// where it has gaps, more where it lies behind itself.
float filledPart(const Facet& facet) {
  const float ellipse = ellipseArea(facet.covariance, glm::normalize(facet.normal));
  return ellipse > 0 ? facet.area / ellipse : 1;
}
}  // namespace

// A surface covers no more than the outline of the sphere that holds all disks, and than its
// ellipse: what exceeds that hides behind the rest.
// The outline of a thicket is that of a ball full of leaves, pi r^2, which has a covariance of r^2
// / 5 along every axis, so an ellipse of 4 pi r^2 / 5.
RoughCover roughCover(const Node& node, const glm::vec3& direction, float shown, int color) {
  const float ellipse = ellipseArea(node, direction), sphere = kPi * node.radius * node.radius;
  const float most = std::min({node.area, sphere, ellipse});
  const float surface = std::min(shown, most);
  constexpr float kThicketOutline = 5.f / 4;
  const float outline = std::min(sphere, kThicketOutline * ellipse);
  const float each = node.opacity(color);
  const float opacity = layersOpacity(each, shown / surface);
  if (!isThicket(node) || !(outline > 0)) return {surface, opacity, most};
  const float area = each * std::min(shown, node.area);
  return {outline, thicketOpacity(area, outline, float(node.surfel_count)),
          std::max(outline, most)};
}

bool isFilled(const Node& node, const Facet& facet) {
  const float surfels = float(node.surfel_count) * facet.area / node.area;
  const float doubt =
      facet.is_two_sided ? 0 : kFidelity.fill_doubt / std::sqrt(std::max(1.f, surfels));
  const float least = kFidelity.least_filled * std::max(0.f, 1 - doubt);
  const float filled = filledPart(facet);
  if (filled >= least) return true;
  const glm::vec3 direction = glm::normalize(facet.normal);
  float shown = 0;
  for (std::size_t i = 0; i < node.facet_count; ++i) {
    if (node.facets[i].isTranslucent() != facet.isTranslucent()) continue;
    const float cosine = glm::dot(direction, node.facets[i].meanNormal());
    if (node.isTwoSided(i) || cosine > 0) shown += float(node.facets[i].area) * std::abs(cosine);
  }
  return filled * node.area * (1.f / 65535) * shown >= least * facet.area;
}

float facetLayers(const Facet& facet) { return std::max(1.f, kPi / 3 * filledPart(facet)); }

// Half of it two-sided, or a sixth spheres, whose outlines are a fourth of their areas.
bool isThicket(const Node& node) { return node.isLoose() && partsOfBand0(node) > 1.5f; }

SymmetricMatrix shapeOf(const SymmetricMatrix& covariance) {
  const float trace = covariance.trace();
  // Of the smallest surfels it may be zero
  if (!(trace >= std::numeric_limits<float>::min())) return withoutDirection(glm::vec3(0));
  return (2 / trace) * covariance;
}

}  // namespace surfeit
