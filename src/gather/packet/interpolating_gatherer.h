// Gathers at some packets of many neighbouring receivers and interpolates at the others, where
// light varies little. docs/many_gathers.md, "Interpolation".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/cut/packet_cluster.h"
#include "gather/cut/packet_cost.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/packet/packet_interpolation.h"

namespace surfeit {

// One thread at a time; make one per thread.
class InterpolatingGatherer {
 public:
  // `rules` must be valid, with a max variation over 0.
  explicit InterpolatingGatherer(const GatherRules& rules,
                                 const PacketKernel& kernel = fastestPacketKernel());

  // Gathers at 1 to kGroupReceivers receivers, whose values must be finite; results are as many. On
  // an error results are incomplete. They depend on the scene, the receivers given together, rules
  // and instruction set alone, bit for bit. What is not interpolated has the bytes that
  // PacketGatherer finds.
  Status gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                std::span<GatherResult> results);

  // Of one octree, in its own coordinates.
  Status gather(std::span<const LocalReceiver> receivers, PagedOctree::Reader& octree,
                std::span<GatherResult> results) {
    WorldReader world(octree);
    return gather(receivers, world, results);
  }

  // Receivers interpolated by all gathers so far.
  std::uint64_t interpolatedCount() const { return interpolated_count_; }
  const PacketGatherer::Work& work() const { return packets_.work(); }

  // Bytes that a gatherer holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules);

 private:
  PacketGatherer packets_;
  PacketInterpolation interpolation_;
  std::vector<PacketCluster> clusters_;
  std::vector<PacketCost> costs_;  // of each cluster, once a packet of it is gathered
  std::array<bool, kGroupClusters> has_cost_{};
  std::uint64_t interpolated_count_ = 0;
};

}  // namespace surfeit
