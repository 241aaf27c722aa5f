// The gather at a group of receivers by the rules: all of them, or with interpolation. One thread
// of the engine or of a job has one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "gather/packet/interpolating_gatherer.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/packet/world_walk.h"
#include "gather/rules/gather_rules.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time.
class GroupGatherer {
 public:
  // Receivers that are gathered together at most.
  static std::size_t groupSize(const GatherRules& rules) {
    return interpolates(rules) ? kGroupReceivers : kClusterReceivers;
  }
  // Bytes that it holds from the start.
  static std::size_t memoryBytes(const GatherRules& rules) {
    return interpolates(rules) ? InterpolatingGatherer::memoryBytes(rules)
                               : PacketGatherer::memoryBytes(rules);
  }

  explicit GroupGatherer(const GatherRules& rules) : size_(groupSize(rules)) {
    if (interpolates(rules)) {
      interpolating_ = std::make_unique<InterpolatingGatherer>(rules);
    } else {
      packets_ = std::make_unique<PacketGatherer>(rules);
    }
  }

  std::size_t size() const { return size_; }

  // Gathers at 1 to size() receivers, whose values must be finite; results are as many. On an error
  // results are incomplete.
  Status gather(std::span<const LocalReceiver> receivers, WorldReader& world,
                std::span<GatherResult> results) {
    return packets_ != nullptr ? packets_->gather(receivers, world, results)
                               : interpolating_->gather(receivers, world, results);
  }

  // Receivers interpolated by all gathers so far.
  std::uint64_t interpolatedCount() const {
    return interpolating_ != nullptr ? interpolating_->interpolatedCount() : 0;
  }

 private:
  static bool interpolates(const GatherRules& rules) { return rules.quality.max_variation > 0; }

  const std::size_t size_;
  std::unique_ptr<PacketGatherer> packets_;  // or
  std::unique_ptr<InterpolatingGatherer> interpolating_;
};

}  // namespace surfeit
