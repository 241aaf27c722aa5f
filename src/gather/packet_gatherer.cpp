#include "gather/packet_gatherer.h"

#include <chrono>

namespace surfeit {
namespace {

// Hands the cut to the raster.
struct DrawCut {
  PacketRaster& raster;
  void node(const Node& node) { raster.addNode(node); }
  void surfels(std::span<const Surfel> run) { raster.addSurfels(run); }
};

}  // namespace

PacketGatherer::PacketGatherer(GatherMode mode, const GatherQuality& quality,
                               const PacketKernel& kernel)
    : raster_(mode, quality, kernel), cut_(quality) {}

// Time since the last call.
double PacketGatherer::phaseSeconds() {
  if (!measures_phases_) return 0;
  const double now =
      std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  const double since = now - last_seconds_;
  last_seconds_ = now;
  return since;
}

Status PacketGatherer::gather(std::span<const Receiver> receivers, PagedOctree::Reader& octree,
                              std::span<GatherResult> results) {
  phaseSeconds();
  const PacketView view = viewPacket(receivers);
  raster_.begin(receivers, view);
  SURFEIT_RETURN_IF_ERROR(cut_.walk(view, octree, DrawCut{raster_}));
  work_ = {.nodes_visited = cut_.nodesVisited(),
           .surfels_visited = cut_.surfelsVisited(),
           .patches = raster_.patchCount()};
  work_.walk_seconds = phaseSeconds();
  raster_.sort();
  work_.sort_seconds = phaseSeconds();
  raster_.draw();
  work_.draw_seconds = phaseSeconds();
  raster_.integrate(results);
  work_.integrate_seconds = phaseSeconds();
  return {};
}

}  // namespace surfeit
