#include "gather/cut/packet_cost.h"

#include <algorithm>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Walking to a patch and preparing it costs as much as drawing this many pixels.
constexpr float kPatchPixels = 25;

// Pixels along a patch of a packet without width.
constexpr float kPatchSide = 2.7f;

// Parts are taken where they cost less than this much more: packets draw what lies far from their
// centre less exactly. (50,000 scattered receivers of the city, over the scalar gather: 1.3 times
// its rate with 1, 1.7 with .85 and with .7.)
constexpr float kWorthDividing = 0.85f;

// So many clusters of a cut tell about the whole.
constexpr std::size_t kSampledClusters = 512;

}  // namespace

PacketCost::PacketCost(const GatherRules& rules)
    : pixels_per_slope_(pixelsPerSlope(rules)), most_side_(float(rules.quality.raster_resolution)) {
  clusters_.reserve(kReservedClusters);
}

void PacketCost::begin(const glm::vec3& position) {
  position_ = position;
  clusters_.clear();
  setFrame(nullptr);
}

void PacketCost::setFrame(const InstanceFrame* frame) {
  local_position_ = frame != nullptr ? frame->toLocal(position_) : position_;
  scale_ = frame != nullptr ? frame->scale : 1;
}

void PacketCost::add(const Node& node, float least_patches) {
  clusters_.push_back({scale_ * glm::distance(node.position, local_position_), least_patches,
                       float(node.surfel_count)});
}

float PacketCost::cost(float radius) const {
  const std::size_t step = clusters_.size() / kSampledClusters + 1;
  float sum = 0;
  for (std::size_t i = 0; i < clusters_.size(); i += step) {
    const auto& [distance, least, most] = clusters_[i];
    const float nearest = std::max(distance - radius, 1e-3f * distance);
    const float ratio = distance / std::max(nearest, 1e-30f);
    const float patches = std::min(most, least * ratio * ratio);
    const float shift = 2 * radius * pixels_per_slope_ / std::max(distance, 1e-30f);
    const float side = std::min(most_side_, kPatchSide + shift);
    sum += patches * (kPatchPixels + side * side);
  }
  return sum * float(step);
}

// Halves cost no less than two receivers alone.
PacketCost::Division PacketCost::divide(std::span<const LocalReceiver> packet, float most_radius,
                                        float least_cost) const {
  const float radius = viewPacket(packet).radius;
  const bool may_stay = radius <= most_radius;
  const Division together = {cost(radius), 1};
  const std::size_t half = packet.size() / 2;
  if (half == 0 || (may_stay && together.cost <= 2 * least_cost)) return together;
  const Division first = divide(packet.first(half), most_radius, least_cost);
  const Division second = divide(packet.subspan(half), most_radius, least_cost);
  const float apart = first.cost + second.cost;
  if (may_stay && together.cost <= kWorthDividing * apart) return together;
  return {apart, first.begins | second.begins << half};
}

}  // namespace surfeit
