#include "gather/packet/interpolating_gatherer.h"

#include <algorithm>

#include "core/assert.h"

namespace surfeit {

InterpolatingGatherer::InterpolatingGatherer(const GatherRules& rules, const PacketKernel& kernel)
    : packets_(rules, kernel), interpolation_(rules) {
  clusters_.reserve(kGroupClusters);
  costs_.reserve(kGroupClusters);
  for (std::size_t i = 0; i < kGroupClusters; ++i) costs_.emplace_back(rules);
}

Status InterpolatingGatherer::gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                                     std::span<GatherResult> results) {
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kGroupReceivers);
  clusters_.clear();
  for (std::size_t i = 0; i < receivers.size(); i += kClusterReceivers) {
    clusters_.emplace_back(receivers.subspan(i, std::min(kClusterReceivers, receivers.size() - i)));
  }
  has_cost_.fill(false);
  interpolation_.begin(clusters_);
  while (true) {
    const std::span<const std::uint16_t> wanted = interpolation_.next(results);
    if (wanted.empty()) break;
    for (const std::uint16_t packet : wanted) {
      const std::size_t at = packet / kClusterPackets;
      const PacketCluster& cluster = clusters_[at];
      if (!has_cost_[at]) SURFEIT_RETURN_IF_ERROR(packets_.foresee(cluster, world, costs_[at]));
      has_cost_[at] = true;
      SURFEIT_RETURN_IF_ERROR(packets_.gatherPacket(cluster, packet % kClusterPackets, costs_[at],
                                                    world,
                                                    results.subspan(at * kClusterReceivers)));
    }
  }
  interpolated_count_ += interpolation_.interpolatedCount();
  return {};
}

std::size_t InterpolatingGatherer::memoryBytes(const GatherRules& rules) {
  return sizeof(InterpolatingGatherer) - sizeof(PacketGatherer) +
         PacketGatherer::memoryBytes(rules) + PacketInterpolation::memoryBytes(rules) +
         kGroupClusters * (sizeof(PacketCluster) + sizeof(PacketCost) + PacketCost::memoryBytes());
}

}  // namespace surfeit
