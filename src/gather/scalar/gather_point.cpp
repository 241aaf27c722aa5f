#include "gather/scalar/gather_point.h"

#include <span>

namespace surfeit {
namespace {

// Hands the cut to the raster.
struct DrawCut {
  ReceiverRaster& raster;
  static float partOf(const LaneParts* parts) { return parts != nullptr ? (*parts)[0] : 1; }
  void node(const Node& node, const LaneParts* parts) { raster.addNode(node, partOf(parts)); }
  void leaf(const Node&) {}
  void surfels(std::span<const Surfel> run, const LaneParts* parts) {
    for (const Surfel& surfel : run) raster.addSurfel(surfel, partOf(parts));
  }
};

}  // namespace

PointGatherer::PointGatherer(const GatherRules& rules)
    : rules_(rules), raster_(rules), cut_(rules, classifySiblings) {}

Status PointGatherer::gather(const LocalReceiver& receiver, PagedOctree::Reader& octree,
                             GatherResult& result) {
  raster_.begin(receiver);
  SURFEIT_RETURN_IF_ERROR(
      cut_.walk(viewPacket({&receiver, 1}, rules_), {&receiver, 1}, octree, DrawCut{raster_}));
  work_ = {.nodes_visited = cut_.nodesVisited(),
           .surfels_visited = cut_.surfelsVisited(),
           .contributions = raster_.contributionCount(),
           .near_surfels = raster_.nearSurfelCount()};
  result = raster_.finish();
  return {};
}

}  // namespace surfeit
