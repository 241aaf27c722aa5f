// What a node adds up over its surfels, in double so that the sums do not drift: a parent's sums
// are those of its children (memo 3.2).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "core/bounds.h"
#include "octree/node.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Sums over surfels i with area A, position x, normal n, radiosity B. Plain data.
struct NodeSums {
  std::uint64_t surfel_count = 0;
  std::uint64_t groups = 0;  // set of groups
  double area = 0;           // sum A
  double origin[3] = {};     // of positions below: the first surfel, so that nothing cancels
  double position[3] = {};   // sum A x
  double second_moment[SymmetricMatrix::kEntries] = {};  // sum A (x x^T + what a disk spreads)
  double front_moment[3][3] = {};                        // sum A x n^T over one-sided disks
  double normal[3] = {};                                 // sum A n over one-sided disks
  double radiosity[3] = {};                              // sum A B
  double sh[kShCount][4] = {};   // sum A K_l Y_lm(n) times 1, B_r, B_g and B_b
  double band_4[kShCount] = {};  // Node::area_band_4
  Bounds3 disk_bounds;           // boxes around every surfel's bounding sphere

  void add(const Surfel& surfel);
  void add(const NodeSums& child);

  // Mean position.
  glm::vec3 centre() const;
  // The node's numbers, without references and radius. `flatness_limit` decides kNodeFlat.
  Node toNode(float flatness_limit) const;

 private:
  void addMoments(const Surfel& surfel);
  void addMoments(const NodeSums& child);
};

// Radius of the sphere around `centre` that holds the box, for when it is smaller than what the
// children's spheres give.
float radiusOfBox(const glm::vec3& centre, const Bounds3& box);

}  // namespace surfeit
