// A cluster: consecutive receivers of the order, divided into packets that lie close together.
// docs/algorithm.md, "Packets".
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "gather/cut/cut.h"
#include "gather/rules/receiver.h"
#include "surfeit/gather.h"

namespace surfeit {

// Consecutive receivers of the order. Runs are whole clusters.
inline constexpr std::size_t kClusterPackets = 16;
inline constexpr std::size_t kClusterReceivers = kClusterPackets * kPacketReceivers;

class PacketCluster {
 public:
  // `receivers`: 1 to kClusterReceivers. They are divided into packets again and again where they
  // lie farthest apart, in space or by their normals: the curve jumps, and packets need not. Halves
  // of packets lie together as well, down to single receivers.
  explicit PacketCluster(std::span<const LocalReceiver> receivers);

  std::size_t packetCount() const { return packet_count_; }
  // The receivers of packet i, and the places they were given at.
  std::span<const LocalReceiver> receivers(std::size_t i) const {
    return std::span(receivers_).subspan(i * kPacketReceivers, packetSize(i));
  }
  std::span<const std::uint16_t> places(std::size_t i) const {
    return std::span(places_).subspan(i * kPacketReceivers, packetSize(i));
  }
  // Wider packets are to be divided.
  float mostPacketRadius() const { return most_packet_radius_; }

 private:
  std::size_t packetSize(std::size_t i) const {
    return std::min(kPacketReceivers, receiver_count_ - i * kPacketReceivers);
  }

  std::size_t receiver_count_, packet_count_ = 0;
  std::array<LocalReceiver, kClusterReceivers> receivers_;  // packet by packet
  std::array<std::uint16_t, kClusterReceivers> places_;
  float most_packet_radius_ = 0;
};

}  // namespace surfeit
