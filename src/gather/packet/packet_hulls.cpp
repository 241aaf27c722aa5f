#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "gather/packet/packet_raster.h"
#include "gather/rules/contribution.h"
#include "gather/rules/fidelity.h"

// The hulls that nodes leave which are looked into (docs/algorithm.md, "Closing").
namespace surfeit {

bool PacketRaster::mayLeaveHull(const Node& node) const {
  return !node.isRough() && float(node.surfel_count) <= kFidelity.most_in_hull &&
         (node.groups & ~rules_.groups) == 0;
}

// Receivers that are at least so far from a place, in the frame of what is added.
std::uint32_t PacketRaster::lanesBeyond(const glm::vec3& position, float distance) const {
  const glm::vec3 place = toWorld(position);
  const float least = frame_ != nullptr ? frame_->scale * distance : distance;
  std::uint32_t lanes = 0;
  for (std::size_t i = 0; i < kPacketReceivers; ++i) {
    const glm::vec3 offset = place - eye(i);
    lanes |= (glm::dot(offset, offset) >= least * least ? 1u : 0u) << i;
  }
  return lanes;
}

// The image of what looks larger is no parallelogram, and what rises from the node's planes by a
// pixel lies elsewhere.
std::uint32_t PacketRaster::addFacetHull(const Node& node, const Facet& facet,
                                         const LaneParts* parts, std::uint32_t lanes) {
  if (!facet.is_two_sided && turnsAway(facet.position, facet.normal)) return lanes;
  if (!isFilled(node, facet)) return 0;
  lanes &= lanesBeyond(facet.position, std::max(std::sqrt(facet.area / largestPatch(rules_)),
                                                node.off_plane * geometry_.pixelsPerSlope()));
  if (lanes == 0) return 0;
  LaneParts seen;
  for (std::size_t i = 0; i < seen.size(); ++i) seen[i] = float(lanes >> i & 1) * partOf(parts, i);
  addFacet(node, facet, true, keepParts(lanes == kAllLanes ? parts : &seen), nullptr, {});
  return lanes;
}

OpenedNode PacketRaster::addHull(const Node& node, const LaneParts* parts,
                                 const OpenedNode& parent) {
  OpenedNode opened = parent;
  const std::uint32_t others = kAllLanes & ~parent.hull_lanes;
  if (others == 0 || !mayLeaveHull(node)) return opened;
  const auto addPiece = [&](const Facet& facet) {
    if (facet.is_two_sided && node.isLoose()) return 0u;
    return addFacetHull(node, facet, parts, others);
  };
  std::uint32_t see_all = others;
  if (node.isFlat()) see_all = addPiece(facetOf(node));
  for (std::size_t i = 0; i < node.facet_count; ++i) see_all &= addPiece(node.facet(i));
  opened.hull_lanes |= see_all;
  return opened;
}

}  // namespace surfeit
