// What a node adds up over its surfels, in double so that the sums do not drift: a parent's sums
// are those of its children (memo 3.2).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "core/bounds.h"
#include "octree/node/area_sums.h"
#include "octree/node/facet_sums.h"
#include "octree/node/node.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Sums over surfels i with area A, opacity o (by color), position x, normal n, radiosity B. Plain
// data.
struct NodeSums : AreaSums {
  std::uint64_t surfel_count = 0;
  std::uint64_t groups = 0;        // set of groups
  double loose_area = 0;           // of kSurfelLoose, less that of other spheres and two-sided ones
  double origin[3] = {};           // of positions: the first surfel, so that nothing cancels
  double front_moment[3][3] = {};  // sum A x n^T over one-sided disks
  double sh[kShCount][4] = {};     // sum A K_l Y_lm(n) times 1, o_r B_r, o_g B_g and o_b B_b
  double band_4[kShCount] = {};    // Node::area_band_4
  FacetSums facets;
  Bounds3 disk_bounds;  // boxes around every surfel's bounding sphere, as it is read back

  void add(const Surfel& surfel);
  void add(const NodeSums& child);

  // Mean position.
  glm::vec3 centre() const;
  // The node's numbers, without references, slab and cone. `radius`: of a sphere around centre()
  // that holds all disks. `flatness_limit` decides what is flat, and what is made of facets that
  // are.
  Node toNode(float flatness_limit, float radius) const;
  // What a flat node is a piece of; normals of two-sided surfels are turned to one side there.
  AreaSums flatPiece(bool is_two_sided, float flatness_limit) const;

 private:
  Facet toFacet(const AreaSums& group) const;
  RoughNode toRough() const;
};

// Radius of the sphere around `centre` that holds the box, for when it is smaller than what the
// children's spheres give.
float radiusOfBox(const glm::vec3& centre, const Bounds3& box);

}  // namespace surfeit
