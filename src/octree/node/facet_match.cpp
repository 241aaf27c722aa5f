#include "octree/node/facet_match.h"

#include <algorithm>
#include <cmath>

namespace surfeit {
namespace {

// Codes of facets and of surfels leave a part of these: of the node's area, of a unit normal, of
// the node's radius, of the square of an opacity.
constexpr double kAreaSlack = 4e-3, kNormalSlack = 5e-3, kPlaceSlack = 2e-2;
constexpr float kHidingSlack = 1e-6f;

bool isFacet(const FacetGroup& group, const double (&origin)[3], double node_area, const Node& node,
             std::size_t k) {
  const NodeFacet& facet = node.facets[k];
  if (node.isTwoSided(k) != group.is_two_sided) return false;
  if (facet.isTranslucent() != group.is_translucent) return false;
  if (hidingDifference(facet.opacity(), group.opacity()) > kHidingSlack) return false;
  if (!group.is_two_sided && facet.hidden != group.hidden) return false;
  if (std::abs(double(facet.area) / 65535 - group.area / node_area) > kAreaSlack) return false;
  const glm::vec3 normal = facet.meanNormal();
  double same = 0, turned = 0, place = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double of_group = group.normal[axis] / group.area;
    same = std::max(same, std::abs(of_group - double(normal[axis])));
    turned = std::max(turned, std::abs(of_group + double(normal[axis])));
    const double at = origin[axis] + group.position[axis] / group.area;
    const double offset = (at - double(node.position[axis])) / double(node.radius);
    const std::uint8_t code = facet.offset[static_cast<std::size_t>(axis)];
    place = std::max(place, std::abs(offset - double(signedFractionOf(code))));
  }
  const double normals = group.is_two_sided ? std::min(same, turned) : same;
  return normals <= kNormalSlack && place <= kPlaceSlack;
}

}  // namespace

std::optional<FacetMatch> matchFacets(const FacetSums& groups, const double (&origin)[3],
                                      const Node& node) {
  const std::span<const FacetGroup> all = groups.groups();
  if (all.size() != node.facet_count) return std::nullopt;
  double area = 0;
  for (const FacetGroup& group : all) area += group.area;
  FacetMatch match{};
  std::array<bool, kMostFacets> is_taken{};
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::size_t k = 0;
    while (k < all.size() && (is_taken[k] || !isFacet(all[i], origin, area, node, k))) ++k;
    if (k == all.size()) return std::nullopt;
    is_taken[k] = true;
    match[i] = k;
  }
  return match;
}

}  // namespace surfeit
