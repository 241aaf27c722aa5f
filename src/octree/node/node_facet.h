// Facets of a node: its surfels in a few groups that face one way each. A corner or an edge is seen
// as the flat pieces that it is made of, and exactly so from near and far.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/symmetric_matrix.h"
#include "octree/node/moment_codes.h"
#include "surfeit/surfel.h"

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
  glm::vec3 radiosity;         // mean, weighted by area and opacity
  SymmetricMatrix covariance;  // Node::covariance
  bool is_two_sided = false;   // seen from both sides; the normal is one of two
  bool is_thicket = false;     // two-sided and loose: of leaves, or hair
  glm::vec3 opacity{1};        // area-weighted mean, by color

  bool isTranslucent() const { return opacity != glm::vec3(1); }
};

// The normals of something that is nearly flat spread by this much to either side of their mean, as
// cosines. `normal`: that mean, shorter where they spread more.
inline float normalRange(const glm::vec3& normal) {
  return std::sqrt(std::max(0.f, 1.5f * (1 - glm::dot(normal, normal))));
}

// How differently surfels of two opacities hide, from 0 to 1: the square of the greatest difference
// of a color.
inline float hidingDifference(const glm::vec3& a, const glm::vec3& b) {
  const glm::vec3 difference = a - b, squares = difference * difference;
  return std::max({squares.r, squares.g, squares.b});
}

// A facet in codes, relative to its node, as pages hold it in either precision: six take less room
// than the harmonics of a rough node.
struct NodeFacet {
  glm::vec3 radiosity;                 // mean, weighted by area and opacity
  std::array<std::int16_t, 3> normal;  // mean, in 1/32767
  std::uint16_t area;                  // in 1/65535 of the node's
  std::array<std::uint8_t, 3> offset;  // from the node's position, a signed fraction of its radius
  CovarianceCodes covariance;          // within its radius
  std::uint8_t hidden;                 // HiddenSides, by its normal
  std::uint16_t transparency;          // as in Surfel
  Tint tint;

  static NodeFacet encode(const Facet& facet, const glm::vec3& position, float radius, float area);
  // These and decode(): what the facet is, by the position, radius and area of the node.
  glm::vec3 positionIn(const glm::vec3& node_position, float node_radius) const {
    return node_position + node_radius * glm::vec3(signedFractionOf(offset[0]),
                                                   signedFractionOf(offset[1]),
                                                   signedFractionOf(offset[2]));
  }
  glm::vec3 meanNormal() const {
    return glm::vec3(normal[0], normal[1], normal[2]) * (1.f / 32767);
  }
  Facet decode(const glm::vec3& node_position, float node_radius, float node_area) const {
    // The radius is between that of a disk, of which the square is twice the trace, and that of a
    // rectangle, three times
    constexpr float kRootOf3 = 1.7320508f;
    return {.position = positionIn(node_position, node_radius),
            .radius = kRootOf3 * deviationOf(covariance, node_radius),
            .normal = meanNormal(),
            .area = node_area * (float(area) * (1.f / 65535)),
            .radiosity = radiosity,
            .covariance = covarianceOf(covariance, node_radius),
            .opacity = opacity()};
  }
  glm::vec3 opacity() const {
    return {opacityOf(transparency), opacityOf(transparencyOf(transparency, tint, 1)),
            opacityOf(transparencyOf(transparency, tint, 2))};
  }
  bool isTranslucent() const { return transparency != 0 || surfeit::isTinted(tint); }
  bool operator==(const NodeFacet&) const = default;
};
static_assert(sizeof(NodeFacet) == 36);

}  // namespace surfeit
