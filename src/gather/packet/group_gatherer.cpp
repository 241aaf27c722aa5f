#include "gather/packet/group_gatherer.h"

#include <algorithm>

#include "core/assert.h"

namespace surfeit {

GroupGatherer::Interpolating::Interpolating(const GatherRules& rules) : interpolation(rules) {
  clusters.reserve(kGroupClusters);
  costs.reserve(kGroupClusters);
  for (std::size_t i = 0; i < kGroupClusters; ++i) costs.emplace_back(rules);
}

GroupGatherer::GroupGatherer(const GatherRules& rules)
    : packets_(rules),
      interpolating_(interpolates(rules) ? std::make_unique<Interpolating>(rules) : nullptr) {}

Status GroupGatherer::gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                             std::span<GatherResult> results) {
  if (interpolating_ == nullptr) return packets_.gather(receivers, world, results);
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kGroupReceivers);
  auto& [interpolation, clusters, costs, has_cost] = *interpolating_;
  clusters.clear();
  for (std::size_t i = 0; i < receivers.size(); i += kClusterReceivers) {
    clusters.emplace_back(receivers.subspan(i, std::min(kClusterReceivers, receivers.size() - i)));
  }
  has_cost.fill(false);
  interpolation.begin(clusters);
  while (true) {
    const std::span<const std::uint16_t> wanted = interpolation.next(results);
    if (wanted.empty()) break;
    for (const std::uint16_t packet : wanted) {
      const std::size_t at = packet / kClusterPackets;
      const PacketCluster& cluster = clusters[at];
      if (!has_cost[at]) SURFEIT_RETURN_IF_ERROR(packets_.foresee(cluster, world, costs[at]));
      has_cost[at] = true;
      SURFEIT_RETURN_IF_ERROR(packets_.gatherPacket(cluster, packet % kClusterPackets, costs[at],
                                                    world,
                                                    results.subspan(at * kClusterReceivers)));
    }
  }
  interpolated_count_ += interpolation.interpolatedCount();
  return {};
}

std::size_t GroupGatherer::memoryBytes(const GatherRules& rules) {
  const std::size_t all = PacketGatherer::memoryBytes(rules);
  if (!interpolates(rules)) return all;
  return all + sizeof(Interpolating) + PacketInterpolation::memoryBytes(rules) +
         kGroupClusters * (sizeof(PacketCluster) + sizeof(PacketCost) + PacketCost::memoryBytes());
}

}  // namespace surfeit
