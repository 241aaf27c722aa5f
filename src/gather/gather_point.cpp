#include "gather/gather_point.h"

#include <glm/geometric.hpp>
#include <span>

namespace surfeit {

PointGatherer::PointGatherer(GatherMode mode, const GatherQuality& quality)
    : quality_(quality), raster_(mode, quality) {}

Status PointGatherer::gather(const Receiver& receiver, PagedOctree::Reader& octree,
                             GatherResult& result) {
  raster_.begin(receiver);
  work_ = {};
  SURFEIT_RETURN_IF_ERROR(selectCut(octree));
  work_.contributions = raster_.contributionCount();
  work_.near_surfels = raster_.nearSurfelCount();
  result = raster_.finish();
  return {};
}

// A node may stand in for its surfels when its bounding sphere looks smaller than twice the max
// solid angle. A flat square of surfels has about 0.6 of its sphere's outline as area, so this is
// close to the memo's test on the area, but it also opens sparse nodes, whose area says nothing
// about how far their surfels spread.
bool PointGatherer::isFarEnough(const Node& node, float distance_sq) const {
  const float radius_sq = node.radius * node.radius;
  return distance_sq > radius_sq && kPi * radius_sq < 2 * quality_.max_solid_angle * distance_sq;
}

// Hands the cut to the raster: nodes small enough as a whole, and the surfels of leaves too near.
Status PointGatherer::selectCut(PagedOctree::Reader& octree) {
  const Receiver& receiver = raster_.receiver();
  std::size_t stack_count = 0;
  stack_[stack_count++] = kRootRange;
  while (stack_count > 0) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> siblings,
                             octree.nodes(stack_[--stack_count]));
    work_.nodes_visited += siblings.size();
    SURFEIT_RETURN_IF_ERROR(octree.checkVisits(work_.nodes_visited, work_.surfels_visited));
    for (const Node& node : siblings) {
      // Skip nodes wholly below the horizon or out of reach
      const glm::vec3 to_node = node.position - receiver.position;
      if (raster_.heightAboveHorizon(to_node) <= -node.radius) continue;
      const float distance_sq = glm::dot(to_node, to_node);
      const float reach = quality_.max_distance + node.radius;
      if (distance_sq > reach * reach) continue;

      if (isFarEnough(node, distance_sq)) {
        raster_.addNode(node);
      } else if (node.isLeaf()) {
        SURFEIT_RETURN_IF_ERROR(octree.visitLeaf(node, [&](std::span<const Surfel> run) {
          work_.surfels_visited += run.size();
          for (const Surfel& surfel : run) raster_.addSurfel(surfel);
        }));
      } else if (stack_count < kStackSize) {
        stack_[stack_count++] = childrenOf(node);
      } else {
        return Status::corruption("octree: deeper than its curve has levels");
      }
    }
  }
  return {};
}

}  // namespace surfeit
