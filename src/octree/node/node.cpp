#include "octree/node/node.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Half the thickness of an even slab with this variance across it.
float halfThickness(const SymmetricMatrix& covariance, const glm::vec3& normal) {
  const float length_sq = glm::dot(normal, normal);
  if (!(length_sq > 0)) return 0;
  return std::sqrt(std::max(0.f, 3 * quadraticForm(covariance, normal) / length_sq));
}

}  // namespace

// The slab of a flat node knows of the few surfels that no moment tells of.
void Node::findOffPlane() {
  off_plane = 0;
  if (isFlat()) {
    off_plane = thickness < radius ? thickness : halfThickness(covariance, normal);
  }
  for (std::size_t i = 0; i < facet_count; ++i) {
    const Facet piece = facet(i);
    off_plane = std::max(off_plane, halfThickness(piece.covariance, piece.normal));
  }
}

}  // namespace surfeit
