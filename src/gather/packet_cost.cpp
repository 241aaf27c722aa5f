#include "gather/packet_cost.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "gather/packet_cluster.h"

namespace surfeit {
namespace {

// A packet that draws no more than this many times what a receiver alone does is not divided.
constexpr float kCheapPacket = 1.5f;

}  // namespace

PacketCost::PacketCost() {
  distances_.reserve(kReservedNodes);
  surfel_counts_.reserve(kReservedNodes);
}

void PacketCost::begin(const glm::vec3& position) {
  position_ = position;
  single_surfels_ = 0;
  distances_.clear();
  surfel_counts_.clear();
}

void PacketCost::node(const Node& node) {
  distances_.push_back(glm::distance(node.position, position_));
  surfel_counts_.push_back(float(node.surfel_count));
}

float PacketCost::patches(float radius) const {
  float sum = single_surfels_;
  for (std::size_t i = 0; i < distances_.size(); ++i) {
    const float nearest = std::max(distances_[i] - radius, 1e-3f * distances_[i]);
    const float ratio = distances_[i] / nearest;
    sum += std::min(surfel_counts_[i], ratio * ratio);
  }
  return sum;
}

// Divided as is best.
float PacketCost::leastPatches(std::span<const Receiver> packet) const {
  const float together = patches(viewPacket(packet).radius);
  const std::size_t half = firstHalf(packet.size());
  if (half == 0 || together <= kCheapPacket * patches(0)) return together;
  return std::min(together, leastPatches(packet.first(half)) + leastPatches(packet.subspan(half)));
}

bool PacketCost::isBetterDivided(std::span<const Receiver> packet) const {
  return packet.size() > 1 && leastPatches(packet) < patches(viewPacket(packet).radius);
}

}  // namespace surfeit
