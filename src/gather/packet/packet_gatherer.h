// The gather of neighbouring receivers from a paged octree, in packets. docs/algorithm.md,
// "Packets".
#pragma once

#include <cstddef>
#include <span>

#include "gather/cut/cut.h"
#include "gather/cut/packet_cluster.h"
#include "gather/cut/packet_cost.h"
#include "gather/packet/packet_raster.h"
#include "gather/packet/world_walk.h"
#include "gather/rules/receiver.h"
#include "octree/read/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time; make one per thread. For its memory see PacketRaster.
class PacketGatherer {
 public:
  // `rules` must be valid, as for PacketRaster.
  explicit PacketGatherer(const GatherRules& rules,
                          const PacketKernel& kernel = fastestPacketKernel());
  PacketGatherer(GatherMode mode, const GatherQuality& quality,
                 const PacketKernel& kernel = fastestPacketKernel())
      : PacketGatherer(GatherRules(mode, quality), kernel) {}

  // Gathers at 1 to kClusterReceivers receivers, whose values must be finite; results are as many.
  // On an error (a page that cannot be read or decoded) results are incomplete. They depend on the
  // scene, the receivers given together, rules and instruction set alone, bit for bit.
  Status gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                std::span<GatherResult> results);
  // Of one octree, in its own coordinates.
  Status gather(std::span<const LocalReceiver> receivers, PagedOctree::Reader& octree,
                std::span<GatherResult> results) {
    WorldReader world(octree);
    return gather(receivers, world, results);
  }

  // The same by parts: packet i of a cluster, whose results are those of all of the cluster, after
  // the cost of its packets was foreseen.
  Status foresee(const PacketCluster& cluster, WorldReader& world, PacketCost& cost);
  Status gatherPacket(const PacketCluster& cluster, std::size_t i, const PacketCost& cost,
                      WorldReader& world, std::span<GatherResult> results);

  // What all gathers so far took, for benches and tests.
  struct Work {
    std::size_t packets = 0;  // drawn, of whatever size
    std::size_t nodes_visited = 0, surfels_visited = 0;
    std::size_t patches = 0;  // drawn
  };
  const Work& work() const { return work_; }
  // What was drawn last, and who is told of it.
  PacketRaster& raster() { return raster_; }

  // Bytes that a gatherer holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules) {
    return sizeof(PacketGatherer) + PacketCost::memoryBytes() + PacketRaster::memoryBytes(rules);
  }

 private:
  Status gatherTogether(std::span<const LocalReceiver> receivers,
                        std::span<const std::uint16_t> places, WorldReader& world,
                        std::span<GatherResult> results);
  Status drawColor(int color, const PacketView& view, std::span<const LocalReceiver> receivers,
                   WorldReader& world);

  const GatherRules rules_;
  PacketRaster raster_;
  WorldWalk walk_;
  PacketCost cost_;
  Work work_;
};

}  // namespace surfeit
