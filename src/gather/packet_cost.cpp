#include "gather/packet_cost.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "gather/packet_cluster.h"

namespace surfeit {
namespace {

// Walking to a patch and preparing it costs as much as drawing this many pixels.
constexpr float kPatchPixels = 25;

// Pixels along a patch of a packet without width.
constexpr float kPatchSide = 2.7f;

// So many clusters of a cut tell about the whole.
constexpr std::size_t kSampledClusters = 512;

}  // namespace

PacketCost::PacketCost(int raster_resolution) : pixels_per_slope_(0.5f * float(raster_resolution)) {
  clusters_.reserve(kReservedClusters);
}

void PacketCost::begin(const glm::vec3& position) {
  position_ = position;
  clusters_.clear();
}

void PacketCost::add(const Node& node, float least_patches) {
  clusters_.push_back(
      {glm::distance(node.position, position_), least_patches, float(node.surfel_count)});
}

float PacketCost::cost(float radius) const {
  const std::size_t step = clusters_.size() / kSampledClusters + 1;
  const float most_side = 2 * pixels_per_slope_;
  float sum = 0;
  for (std::size_t i = 0; i < clusters_.size(); i += step) {
    const auto& [distance, least, most] = clusters_[i];
    const float nearest = std::max(distance - radius, 1e-3f * distance);
    const float ratio = distance / std::max(nearest, 1e-30f);
    const float patches = std::min(most, least * ratio * ratio);
    const float shift = 2 * radius * pixels_per_slope_ / std::max(distance, 1e-30f);
    const float side = std::min(most_side, kPatchSide + shift);
    sum += patches * (kPatchPixels + side * side);
  }
  return sum * float(step);
}

// Halves cost no less than two receivers alone.
PacketCost::Division PacketCost::divide(std::span<const Receiver> packet, float least_cost) const {
  const Division together = {cost(viewPacket(packet).radius), 1};
  const std::size_t half = firstHalf(packet.size());
  if (half == 0 || together.cost <= 2 * least_cost) return together;
  const Division first = divide(packet.first(half), least_cost);
  const Division second = divide(packet.subspan(half), least_cost);
  const float apart = first.cost + second.cost;
  if (together.cost <= apart) return together;
  return {apart, first.begins | second.begins << half};
}

}  // namespace surfeit
