// Facets of a node: its surfels in a few groups that face one way each. A corner or an edge is seen
// as the flat pieces that it is made of, and exactly so from near and far.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "core/symmetric_matrix.h"
#include "octree/moment_codes.h"

namespace surfeit {

// A box has six. (Sponza with rough nodes as large as flat ones: AO RMSE .0131 with up to 3 facets,
// .0046 with 4, .0042 with 6.)
inline constexpr std::size_t kMostFacets = 6;

// A flat piece of surface as the gather sees it: a facet, or a flat node.
struct Facet {
  glm::vec3 position;  // area-weighted mean
  float radius;        // of a disk that spreads about as it does
  glm::vec3 normal;    // mean over the area: shorter where it is curved
  float area;
  glm::vec3 radiosity;         // area-weighted mean
  SymmetricMatrix covariance;  // Node::covariance
};

// A facet in codes, relative to its node, as pages hold it in either precision: six take less room
// than the harmonics of a rough node.
struct NodeFacet {
  glm::vec3 radiosity;                 // area-weighted mean
  std::array<std::int16_t, 3> normal;  // mean, in 1/32767
  std::uint16_t area;                  // in 1/65535 of the node's
  std::array<std::uint8_t, 3> offset;  // from the node's position, a signed fraction of its radius
  CovarianceCodes covariance;          // within its radius

  static NodeFacet encode(const Facet& facet, const glm::vec3& position, float radius, float area);
  // `position`, `radius` and `area`: of the node.
  Facet decode(const glm::vec3& node_position, float node_radius, float node_area) const {
    Facet facet;
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(axis);
      facet.position[axis] = node_position[axis] + node_radius * signedFractionOf(offset[i]);
      facet.normal[axis] = float(normal[i]) * (1.f / 32767);
    }
    facet.area = node_area * (float(area) * (1.f / 65535));
    facet.radiosity = radiosity;
    facet.covariance = covarianceOf(covariance, node_radius);
    // Between a disk, of which the square is twice the trace, and a rectangle, three times
    facet.radius = std::sqrt(3 * facet.covariance.trace());
    return facet;
  }
  bool operator==(const NodeFacet&) const = default;
};
static_assert(sizeof(NodeFacet) == 32);

}  // namespace surfeit
