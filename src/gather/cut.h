// The cut: the nodes and surfels of the octree that a receiver sees (memo, section 3). Walked by
// the gather, which draws them, and by whoever wants to know which pages that takes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>

#include "core/curve_key.h"
#include "gather/receiver_raster.h"
#include "octree/node.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// A node may stand in for its surfels when its bounding sphere looks smaller than twice the max
// solid angle. A flat square of surfels has about 0.6 of its sphere's outline as area, so this is
// close to the memo's test on the area, but it also opens sparse nodes, whose area says nothing
// about how far their surfels spread.
inline bool isFarEnough(const Node& node, float distance_sq, float max_solid_angle) {
  const float radius_sq = node.radius * node.radius;
  return distance_sq > radius_sq && kPi * radius_sq < 2 * max_solid_angle * distance_sq;
}

// Calls visit.node(const Node&) for the nodes small enough as a whole, and
// visit.surfels(std::span<const Surfel>) for those of leaves too near. `Reader` has the functions
// of PagedOctree::Reader. The order depends on the octree alone. One thread at a time.
class CutWalk {
 public:
  template <typename Reader, typename Visit>
  Status walk(const Receiver& receiver, const GatherQuality& quality, Reader& octree,
              Visit&& visit) {
    nodes_visited_ = surfels_visited_ = 0;
    std::size_t stack_count = 0;
    stack_[stack_count++] = kRootRange;
    while (stack_count > 0) {
      SURFEIT_ASSIGN_OR_RETURN(const std::span<const Node> siblings,
                               octree.nodes(stack_[--stack_count]));
      nodes_visited_ += siblings.size();
      SURFEIT_RETURN_IF_ERROR(octree.checkVisits(nodes_visited_, surfels_visited_));
      for (const Node& node : siblings) {
        // Skip nodes wholly below the horizon or out of reach
        const glm::vec3 to_node = node.position - receiver.position;
        if (heightAboveHorizon(receiver, to_node) <= -node.radius) continue;
        const float distance_sq = glm::dot(to_node, to_node);
        const float reach = quality.max_distance + node.radius;
        if (distance_sq > reach * reach) continue;

        if (isFarEnough(node, distance_sq, quality.max_solid_angle)) {
          visit.node(node);
        } else if (node.isLeaf()) {
          SURFEIT_RETURN_IF_ERROR(octree.visitLeaf(node, [&](std::span<const Surfel> run) {
            surfels_visited_ += run.size();
            visit.surfels(run);
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

  // Of the last walk.
  std::uint64_t nodesVisited() const { return nodes_visited_; }
  std::uint64_t surfelsVisited() const { return surfels_visited_; }

 private:
  // Every level leaves at most 7 sibling ranges behind on the way down, the last one 8.
  static constexpr std::size_t kStackSize = 7 * (kCurveLevels + 1) + 8;

  std::array<NodeRange, kStackSize> stack_;
  std::uint64_t nodes_visited_ = 0, surfels_visited_ = 0;
};

// For walks that are made for the pages they touch.
struct IgnoreCut {
  void node(const Node&) {}
  void surfels(std::span<const Surfel>) {}
};

}  // namespace surfeit
