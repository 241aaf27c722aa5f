#include "octree/build/cell_sweep.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "octree/page/node_bounds.h"

namespace surfeit {

// In double where the square of the distance is no normal float: clouds of the least sizes.
float reach(const glm::vec3& centre, const glm::vec3& at, float radius) {
  const glm::vec3 d = at - centre;
  constexpr float kLeastSquare = 0x1p-100f;
  const float distance = glm::dot(d, d) >= kLeastSquare
                             ? glm::length(d)
                             : float(glm::distance(glm::dvec3(at), glm::dvec3(centre)));
  return (distance + radius) * 1.000001f;
}

void CellSweep::OpenCell::add(const FinishedNode& child) {
  children[child_count++] = child.node;
  sums.add(child.sums);
}

bool CellSweep::place(FinishedNode& node, int boundary_level, int top_level,
                      std::span<const Surfel> surfels) {
  // Close the cells that end here; each takes the node and becomes the node
  while (depth_ > 0 && cells_[depth_ - 1].level >= boundary_level) {
    OpenCell& cell = cells_[--depth_];
    cell.add(node);
    close(cell, surfels, node);
  }
  if (boundary_level <= top_level) return true;
  // The node and the next one are children of one cell of the level above the boundary
  if (depth_ == 0 || cells_[depth_ - 1].level < boundary_level - 1) {
    OpenCell& opened = cells_[depth_++];
    opened.level = boundary_level - 1;
    opened.child_count = 0;
    opened.sums = NodeSums();
  }
  cells_[depth_ - 1].add(node);
  return false;
}

void CellSweep::close(const OpenCell& cell, std::span<const Surfel> surfels, FinishedNode& parent) {
  const std::span<const LevelNode> children = std::span(cell.children).first(cell.child_count);
  const GroupPlace place = sink_.addSiblings(cell.level + 1, children);
  parent.sums = cell.sums;
  const glm::vec3 centre = cell.sums.centre();
  float radius = 0;
  for (const LevelNode& child : children) {
    radius = std::max(radius, reach(centre, child.node.position, child.node.radius));
  }
  radius = std::min(radius, radiusOfBox(centre, cell.sums.disk_bounds) * 1.000001f);
  Node& node = parent.node.node;
  node = cell.sums.toNode(flatness_limit_, radius);
  if (cell.sums.surfel_count <= surfels.size()) {
    boundSurfels(surfels.last(cell.sums.surfel_count), parent.node);
  } else {
    boundChildren(children, parent.node);
  }
  node.page = place.page;
  node.first = place.first;
  node.child_count = cell.child_count;
  parent.node.child_level = static_cast<std::uint8_t>(cell.level + 1);
  for (const LevelNode& child : children) parent.node.marks |= child.marks;
}

}  // namespace surfeit
