#include "gather/rules/layers.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "octree/node/hidden_layers.h"

namespace surfeit {
namespace {

// What an eye at this height above it sees of a piece with hidden sides that consists of surfels of
// this area.
float seenFrom(float height, std::uint8_t hidden, float area) {
  if ((hidden & (height > 0 ? kHiddenFront : kHiddenBack)) == 0) return 1;
  return std::clamp(2 - std::abs(height) / (kClosestLayers * std::sqrt(area)), 0.f, 1.f);
}

}  // namespace

bool hasHiddenPieces(const Node& node) {
  if (node.isFlat()) return node.hidden != 0;
  const auto facets = std::span(node.facets).first(node.facet_count);
  return std::any_of(facets.begin(), facets.end(),
                     [](const NodeFacet& facet) { return facet.hidden != 0; });
}

float seenOfPiece(const Node& node, std::size_t i, const glm::vec3& eye) {
  const float area = node.area / float(node.surfel_count);
  if (node.isFlat()) {
    return seenFrom(glm::dot(eye - node.position, node.normal), node.hidden, area);
  }
  const NodeFacet& facet = node.facets[i];
  const glm::vec3 normal = facet.meanNormal();
  const glm::vec3 from_facet = eye - facet.positionIn(node.position, node.radius);
  return seenFrom(glm::dot(from_facet, normal) / glm::length(normal), facet.hidden, area);
}

float seenOf(const Surfel& surfel, const glm::vec3& eye) {
  return seenFrom(glm::dot(eye - surfel.position, surfel.normal), hiddenSidesOf(surfel),
                  surfel.area);
}

}  // namespace surfeit
