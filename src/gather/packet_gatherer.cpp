#include "gather/packet_gatherer.h"

#include <array>
#include <chrono>

namespace surfeit {
namespace {

// Hands the cut to the raster.
struct DrawCut {
  PacketRaster& raster;
  const CutRegion& region;
  void node(const Node& node) { raster.addNode(node); }
  void surfels(std::span<const Surfel> run) { raster.addSurfels(run, region); }
};

}  // namespace

PacketGatherer::PacketGatherer(GatherMode mode, const GatherQuality& quality,
                               const PacketKernel& kernel)
    : quality_(quality),
      raster_(mode, quality, kernel),
      far_raster_(mode, quality, kernel),
      cut_(quality) {}

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
  raster.begin(receivers, view);
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

Status PacketGatherer::gather(std::span<const Receiver> receivers, PagedOctree::Reader& octree,
                              std::span<GatherResult> results) {
  double ignored = 0;
  endPhase(ignored);
  const PacketCluster cluster(receivers, quality_);
  if (cluster.shares()) {
    SURFEIT_RETURN_IF_ERROR(
        draw(cluster.view(), cluster.farRegion(), cluster.centres(), octree, far_raster_));
    far_raster_.finishFarField();
    work_.shared_patches += far_raster_.patchCount();
  }
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    SURFEIT_RETURN_IF_ERROR(
        draw(cluster.packet(i), cluster.regionOf(i), cluster.receivers(i), octree, raster_));
    work_.patches += raster_.patchCount();
    ++work_.packets;
    const std::span<const std::uint16_t> places = cluster.places(i);
    std::array<GatherResult, kPacketReceivers> packet_results;
    raster_.integrate(std::span(packet_results).first(places.size()),
                      cluster.shares(i) ? &far_raster_ : nullptr, i, cluster.farDistance());
    for (std::size_t k = 0; k < places.size(); ++k) results[places[k]] = packet_results[k];
    endPhase(work_.integrate_seconds);
  }
  return {};
}

}  // namespace surfeit
