// The gather at a group of receivers by the rules: at all of them, or, with a max variation, at
// some packets, and the others are interpolated where light varies little.
// docs/many_gathers.md, "Interpolation".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gather/cut/packet_cluster.h"
#include "gather/cut/packet_cost.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/packet/packet_interpolation.h"
#include "gather/packet/world_walk.h"
#include "gather/rules/gather_rules.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time; a thread of the engine or of a job has one.
class GroupGatherer {
 public:
  // Receivers that are gathered together at most.
  static std::size_t groupSize(const GatherRules& rules) {
    return interpolates(rules) ? kGroupReceivers : kClusterReceivers;
  }
  // Bytes that it holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules);

  explicit GroupGatherer(const GatherRules& rules);

  std::size_t size() const {
    return interpolating_ != nullptr ? kGroupReceivers : kClusterReceivers;
  }

  // Gathers at 1 to size() receivers, whose values must be finite; results are as many. On an error
  // results are incomplete. They depend on the scene, the receivers given together, rules and
  // instruction set alone, bit for bit. What is not interpolated has the bytes that PacketGatherer
  // finds.
  Status gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                std::span<GatherResult> results);

  // Receivers interpolated by all gathers so far.
  std::uint64_t interpolatedCount() const { return interpolated_count_; }

 private:
  static bool interpolates(const GatherRules& rules) { return rules.quality.max_variation > 0; }

  struct Interpolating {
    explicit Interpolating(const GatherRules& rules);
    PacketInterpolation interpolation;
    std::vector<PacketCluster> clusters;
    std::vector<PacketCost> costs;  // of each cluster, once a packet of it is gathered
    std::array<bool, kGroupClusters> has_cost{};
  };

  PacketGatherer packets_;
  std::unique_ptr<Interpolating> interpolating_;  // null: all are gathered
  std::uint64_t interpolated_count_ = 0;
};

}  // namespace surfeit
