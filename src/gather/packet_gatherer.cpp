#include "gather/packet_gatherer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

namespace surfeit {
namespace {

// Hands the cut to the raster.
struct DrawCut {
  PacketRaster& raster;
  const CutRegion& region;
  void node(const Node& node, const Blend& blend) { raster.addNode(node, blend); }
  void leaf(const Node&) {}
  void surfels(std::span<const Surfel> run, const Blend& blend) {
    raster.addSurfels(run, region, blend);
  }
};

}  // namespace

PacketGatherer::PacketGatherer(const GatherRules& rules, const PacketKernel& kernel)
    : rules_(rules), raster_(rules, kernel), cut_(rules), cost_(rules) {
  if (PacketCluster::mayShare(rules)) far_field_.emplace(rules, kernel);
}

// Adds the time since the last call.
void PacketGatherer::endPhase(double& seconds) {
  if (!measures_phases_) return;
  const double now =
      std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  seconds += now - phase_begin_;
  phase_begin_ = now;
}

Status PacketGatherer::draw(const PacketView& view, const CutRegion& region,
                            std::span<const Receiver> receivers, PagedOctree::Reader& octree,
                            PacketRaster& raster) {
  const bool is_shared = region.part == CutRegion::Part::kFar;
  raster.begin(receivers, view, is_shared ? PacketCluster::kHorizonSlack : 0);
  SURFEIT_RETURN_IF_ERROR(cut_.walk(view, region, octree, DrawCut{raster, region}));
  work_.nodes_visited += cut_.nodesVisited();
  work_.surfels_visited += cut_.surfelsVisited();
  endPhase(work_.walk_seconds);
  raster.sort();
  endPhase(work_.sort_seconds);
  raster.draw();
  endPhase(work_.draw_seconds);
  return {};
}

// Some receivers of a packet.
struct PacketGatherer::Part {
  std::span<const Receiver> receivers;
  std::span<const std::uint16_t> places;  // of their results
  CutRegion region;
  std::optional<SharedFarField> far;

  Part of(std::size_t begin, std::size_t count) const {
    Part part = *this;
    part.receivers = receivers.subspan(begin, count);
    part.places = places.subspan(begin, count);
    return part;
  }
};

Status PacketGatherer::gatherPart(const Part& part, PagedOctree::Reader& octree,
                                  std::span<GatherResult> results) {
  SURFEIT_RETURN_IF_ERROR(
      draw(viewPacket(part.receivers, rules_), part.region, part.receivers, octree, raster_));
  work_.patches += raster_.patchCount();
  ++work_.packets;
  const std::size_t count = part.receivers.size();
  std::array<GatherResult, kPacketReceivers> packet_results;
  raster_.integrate(std::span(packet_results).first(count), part.far ? &*part.far : nullptr);
  for (std::size_t k = 0; k < count; ++k) results[part.places[k]] = packet_results[k];
  endPhase(work_.integrate_seconds);
  return {};
}

Status PacketGatherer::gather(std::span<const Receiver> receivers, PagedOctree::Reader& octree,
                              std::span<GatherResult> results) {
  double ignored = 0;
  endPhase(ignored);
  const PacketCluster cluster(receivers, rules_);
  cost_.begin(cluster.receivers(0)[0].position);
  SURFEIT_RETURN_IF_ERROR(
      cut_.walk(viewPacket(cluster.receivers(0).first(1), rules_), {}, octree, cost_));
  if (cluster.shares()) {
    SURFEIT_RETURN_IF_ERROR(
        draw(cluster.view(), cluster.farRegion(), cluster.centres(), octree, far_field_->raster()));
    far_field_->finish(cluster);
    endPhase(work_.draw_seconds);
    work_.shared_patches += far_field_->raster().patchCount();
  }
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    Part packet = {.receivers = cluster.receivers(i),
                   .places = cluster.places(i),
                   .region = cluster.regionOf(i),
                   .far = {}};
    if (cluster.shares(i)) packet.far = far_field_->of(cluster, i);
    SURFEIT_RETURN_IF_ERROR(cost_.forEachPart(
        packet.receivers, cluster.mostPacketRadius(), [&](std::size_t begin, std::size_t count) {
          return gatherPart(packet.of(begin, count), octree, results);
        }));
  }
  return {};
}

}  // namespace surfeit
