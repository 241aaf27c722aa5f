// Bounds of place and direction that a node has beside its sphere: a slab across its normal and a
// cone around it, so that a gather may drop a node by proof. They hold for the surfels below as a
// reader decodes them, and are stored in a byte each (docs/format.md, "Node-group page").
//
//        normal    cone: the normals of the surfels
//           \ | /
//      ------\|/------  +thickness
//     (  disks in the slab  )  radius
//      ---------------  -thickness
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "octree/node/node.h"
#include "octree/page/node_group.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Give a node the slab and the cone of what lies below it: the surfels of a leaf, or children with
// bounds of their own. Position, radius and normal are there.
void boundSurfels(std::span<const Surfel> surfels, LevelNode& leaf);
void boundChildren(std::span<const LevelNode> children, LevelNode& parent);

// The bounds as bytes: of a node that a reader decodes with this position and normal, and a radius
// that is no smaller.
struct BoundCodes {
  std::uint8_t thickness = 255;
  std::uint8_t cone = 255;
};
BoundCodes boundCodes(const LevelNode& node, const glm::vec3& position, const glm::vec3& normal);

// Gives a decoded node what the bytes tell. Any are legal. Radius and normal are there.
void setBounds(BoundCodes codes, Node& node);

// Farthest that what lies in a node's sphere and slab reaches from its position along `direction`,
// a unit vector.
double supportOf(const Node& node, const glm::dvec3& direction);

}  // namespace surfeit
