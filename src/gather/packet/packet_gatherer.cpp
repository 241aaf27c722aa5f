#include "gather/packet/packet_gatherer.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace surfeit {
namespace {

// Hands the cut to the raster.
struct DrawCut {
  PacketRaster& raster;
  const PagedOctree::Reader& octree;
  void setFrame(const InstanceFrame* frame) { raster.setFrame(frame); }
  void node(const Node& node, const LaneParts* parts) {
    raster.addNode(node, parts, octree.lobesOf(node));
  }
  OpenedNode opened(const Node& node, const LaneParts* parts, OpenedNode parent) {
    return raster.addHull(node, parts, parent);
  }
  void surfels(std::span<const Surfel> run, const LaneParts* parts) {
    raster.addSurfels(run, parts, octree.lobesOf(run));
  }
};

}  // namespace

PacketGatherer::PacketGatherer(const GatherRules& rules, const PacketKernel& kernel)
    : rules_(rules), raster_(rules, kernel), walk_(rules), cost_(rules) {}

Status PacketGatherer::gatherTogether(std::span<const LocalReceiver> receivers,
                                      std::span<const std::uint16_t> places, WorldReader& world,
                                      std::span<GatherResult> results) {
  std::array<GatherResult, kPacketReceivers> packet_results;
  const std::span<GatherResult> found = std::span(packet_results).first(receivers.size());
  const PacketView view = viewPacket(receivers, rules_);
  SURFEIT_RETURN_IF_ERROR(drawColor(0, view, receivers, world));
  if (!raster_.hasTints()) {
    raster_.integrate(found);
  } else {
    for (int color = 0; color < 3; ++color) {
      if (color > 0) SURFEIT_RETURN_IF_ERROR(drawColor(color, view, receivers, world));
      raster_.integrateColor(found);
    }
  }
  for (std::size_t k = 0; k < receivers.size(); ++k) results[places[k]] = packet_results[k];
  return {};
}

// Where nothing has a tint, red stands for all.
Status PacketGatherer::drawColor(int color, const PacketView& view,
                                 std::span<const LocalReceiver> receivers, WorldReader& world) {
  raster_.setColor(color);
  raster_.begin(receivers, view);
  SURFEIT_RETURN_IF_ERROR(walk_.walk(view, receivers, world, DrawCut{raster_, world.octree()}));
  work_.nodes_visited += walk_.nodesVisited();
  work_.surfels_visited += walk_.surfelsVisited();
  work_.patches += raster_.patchCount();
  ++work_.packets;
  raster_.sort();
  raster_.draw();
  return {};
}

Status PacketGatherer::foresee(const PacketCluster& cluster, WorldReader& world, PacketCost& cost) {
  const std::span<const LocalReceiver> first = cluster.receivers(0).first(1);
  cost.begin(first[0].position);
  return walk_.walk(viewPacket(first, rules_), first, world, cost);
}

Status PacketGatherer::gatherPacket(const PacketCluster& cluster, std::size_t i,
                                    const PacketCost& cost, WorldReader& world,
                                    std::span<GatherResult> results) {
  const std::span<const LocalReceiver> packet = cluster.receivers(i);
  const std::span<const std::uint16_t> places = cluster.places(i);
  return cost.forEachPart(packet, cluster.mostPacketRadius(),
                          [&](std::size_t begin, std::size_t count) {
                            return gatherTogether(packet.subspan(begin, count),
                                                  places.subspan(begin, count), world, results);
                          });
}

Status PacketGatherer::gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                              std::span<GatherResult> results) {
  const PacketCluster cluster(receivers);
  SURFEIT_RETURN_IF_ERROR(foresee(cluster, world, cost_));
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    SURFEIT_RETURN_IF_ERROR(gatherPacket(cluster, i, cost_, world, results));
  }
  return {};
}

}  // namespace surfeit
