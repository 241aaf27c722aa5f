#include "gather/cut/packet_cluster.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/assert.h"

namespace surfeit {
namespace {

// Where the curve jumps, a packet has receivers on both sides. One that is wider than this many
// times the median is divided: it sees what is near from between them. (Largest step of occlusion
// along lines in a box, bench/line_steps.sh: .0066 without this, .0030 with it.)
constexpr float kMostPacketWidth = 4;

// Part of the radius of what is divided that a difference of normals of 1 counts like: it changes
// which receivers share a packet, and no result of one alone.
constexpr float kNormalWeight = 0.5f;

using Places = std::span<std::uint16_t>;

// Position and weighted normal.
float coordinate(const LocalReceiver& receiver, int axis, float normal_weight) {
  return axis < 3 ? receiver.position[axis] : normal_weight * receiver.normal[axis - 3];
}

// Orders places of `receivers` by halving them. Each kPacketReceivers of them, but for the last,
// are a packet.
void divideReceivers(Places places, std::span<const LocalReceiver> receivers, float normal_weight) {
  if (places.size() <= 1) return;
  int widest = 0;
  float width = -1;
  for (int axis = 0; axis < 6; ++axis) {
    float least = std::numeric_limits<float>::max(), most = std::numeric_limits<float>::lowest();
    for (const std::uint16_t place : places) {
      const float x = coordinate(receivers[place], axis, normal_weight);
      least = std::min(least, x);
      most = std::max(most, x);
    }
    if (most - least > width) {
      width = most - least;
      widest = axis;
    }
  }
  const std::size_t packets = (places.size() + kPacketReceivers - 1) / kPacketReceivers;
  const std::size_t half = packets > 1 ? packets / 2 * kPacketReceivers : places.size() / 2;
  std::nth_element(places.begin(), places.begin() + std::ptrdiff_t(half), places.end(),
                   [&](std::uint16_t a, std::uint16_t b) {
                     const float x = coordinate(receivers[a], widest, normal_weight);
                     const float y = coordinate(receivers[b], widest, normal_weight);
                     return x != y ? x < y : a < b;
                   });
  divideReceivers(places.first(half), receivers, normal_weight);
  divideReceivers(places.subspan(half), receivers, normal_weight);
}

}  // namespace

PacketCluster::PacketCluster(std::span<const LocalReceiver> receivers)
    : receiver_count_(receivers.size()) {
  SURFEIT_ASSERT(!receivers.empty() && receivers.size() <= kClusterReceivers);
  const Places places = std::span(places_).first(receiver_count_);
  std::iota(places.begin(), places.end(), std::uint16_t{0});
  divideReceivers(places, receivers, kNormalWeight * viewPacket(receivers).radius);
  for (std::size_t i = 0; i < receiver_count_; ++i) receivers_[i] = receivers[places_[i]];

  std::array<float, kClusterPackets> widths{};
  for (std::size_t at = 0; at < receiver_count_; at += kPacketReceivers) {
    widths[packet_count_] = viewPacket(this->receivers(packet_count_)).radius;
    ++packet_count_;
  }
  const auto middle = widths.begin() + std::ptrdiff_t(packet_count_ / 2);
  std::nth_element(widths.begin(), middle, widths.begin() + std::ptrdiff_t(packet_count_));
  most_packet_radius_ = kMostPacketWidth * *middle;
}

}  // namespace surfeit
