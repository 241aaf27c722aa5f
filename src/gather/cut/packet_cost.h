// What a packet costs by its width, foreseen from the cut of one receiver. A wide packet opens what
// is near to any of its receivers, so scattered receivers are cheaper in narrow packets or alone.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "gather/cut/cut.h"
#include "gather/cut/instance_tree.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/receiver.h"
#include "octree/node/node.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Visits the cut of a receiver (CutWalk), then answers. One thread at a time.
class PacketCost {
 public:
  // Room for the clusters of a cut; more for larger ones, as PacketRaster.
  static constexpr std::size_t kReservedClusters = 4096;
  explicit PacketCost(const GatherRules& rules);

  // Starts over for a receiver here.
  void begin(const glm::vec3& position);
  // What follows is of an instance; null: of the world.
  void setFrame(const InstanceFrame* frame);
  void node(const Node& node, const LaneParts*) {
    add(node, float(std::max<int>(1, node.facet_count)));
  }
  OpenedNode opened(const Node& node, const LaneParts*, OpenedNode) {
    if (node.isLeaf()) add(node, float(node.surfel_count));
    return {};
  }
  void surfels(std::span<const Surfel>, const LaneParts*) {}

  // What a packet of this radius around the receiver takes, in some unit of time. A node of s
  // surfels at distance d is seen from d - radius at nearest, and gives way to about
  // (d / (d - radius))^2 smaller ones, at most to its surfels; and what is drawn covers more
  // pixels, as every receiver sees it elsewhere.
  float cost(float radius) const;

  static constexpr std::size_t memoryBytes() { return kReservedClusters * sizeof(Cluster); }

  // Calls visit(begin, count), which answers a Status, for the parts that the receivers of a packet
  // are best gathered in: all, or halves, or halves of these, whatever draws least, but
  // none wider than `most_radius`. Stops at the first failure.
  template <typename Visit>
  Status forEachPart(std::span<const LocalReceiver> packet, float most_radius,
                     Visit&& visit) const {
    std::uint32_t begins = divide(packet, most_radius, cost(0)).begins;
    while (begins != 0) {
      const auto begin = static_cast<std::size_t>(std::countr_zero(begins));
      begins &= begins - 1;
      const std::size_t end =
          begins != 0 ? static_cast<std::size_t>(std::countr_zero(begins)) : packet.size();
      SURFEIT_RETURN_IF_ERROR(visit(begin, end - begin));
    }
    return {};
  }

 private:
  // A node, or the surfels of a leaf.
  struct Cluster {
    float distance;
    float least, most;  // patches that it is drawn as
  };
  struct Division {
    float cost;            // of all parts
    std::uint32_t begins;  // bit i: a part begins at receiver i
  };
  void add(const Node& node, float least_patches);
  Division divide(std::span<const LocalReceiver> packet, float most_radius, float least_cost) const;

  const float pixels_per_slope_, most_side_;
  glm::vec3 position_{0}, local_position_{0};
  float scale_ = 1;
  std::vector<Cluster> clusters_;
};

}  // namespace surfeit
