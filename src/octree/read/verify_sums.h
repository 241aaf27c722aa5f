// The part of verify that holds what a node tells of its surfels against them: mean position and
// normal, covariance, harmonics and moments of a rough node, facets. docs/format.md, "Invariants".
#pragma once

#include <glm/vec3.hpp>
#include <limits>
#include <string>

#include "octree/node/node.h"
#include "octree/node/node_sums.h"

namespace surfeit {

// Sums over the surfels below a node as a reader decodes them. Plain data.
struct SumsBelow {
  NodeSums sums;
  double two_sided[SymmetricMatrix::kEntries] = {};  // sum A n n^T over two-sided disks
  // Radiosities of each color.
  glm::vec3 least{std::numeric_limits<float>::infinity()}, greatest{0};

  void add(const Surfel& surfel);
  void add(const SumsBelow& child);
};

// What tells how much a file may differ from the sums.
struct SumsTolerance {
  bool full_precision = false;
  bool has_variances = false, has_slopes = false;
  float flatness_limit = 0;
  float brightest = 0;  // radiosity of a surfel or a node of the file
};

// What the node tells that is not so, or nothing.
std::string wrongSum(const Node& node, const SumsBelow& below, const SumsTolerance& tolerance);

}  // namespace surfeit
