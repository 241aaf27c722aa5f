// A cluster: neighbouring packets that look at what is far away together. Seen from one packet, far
// things stand at nearly the same place for all of its receivers; so the far field is drawn once
// for a whole packet, from its centre, and 16 packets are drawn at once, in the 16 lanes of one
// raster. docs/algorithm.md, "The shared far field".
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "gather/cut.h"
#include "gather/receiver.h"
#include "surfeit/gather.h"

namespace surfeit {

// Consecutive receivers of the order that may share a far field. Runs are whole clusters.
inline constexpr std::size_t kClusterPackets = 16;
inline constexpr std::size_t kClusterReceivers = kClusterPackets * kPacketReceivers;

// Where a packet of this size is halved.
inline std::size_t firstHalf(std::size_t packet_size) { return packet_size / 2; }

// Orders places of `receivers` by halving them again and again where they lie farthest apart, in
// space or by their normals, of which a difference of 1 counts like a distance of normal_weight.
// Each kPacketReceivers of them, but for the last, are a packet, and halves of packets lie together
// as well, down to `whole` places.
void divideReceivers(std::span<std::uint16_t> places, std::span<const Receiver> receivers,
                     float normal_weight, std::size_t whole = 1);

// A difference of normals of 1 counts like this part of the radius of what is divided.
inline constexpr float kNormalWeight = 0.5f;

class PacketCluster {
 public:
  // Receivers whose normals lie farther from their mean (cosine) have no horizon in common: nothing
  // of their far field may be dropped for lying below it. The horizons of others differ by an angle
  // of this sine at most.
  static constexpr float kOneHorizon = 0.99f, kHorizonSlack = 0.1415f;
  static_assert(kOneHorizon * kOneHorizon + kHorizonSlack * kHorizonSlack > 1);

  // Whether clusters of such gathers may share anything: cones that look elsewhere have no raster
  // in common.
  static bool mayShare(const GatherRules& rules) {
    return rules.quality.far_field_parallax > 0 && !rules.hasConeRaster();
  }

  // `receivers`: 1 to kClusterReceivers. They are divided into packets again and again where they
  // lie farthest apart, in space or by their normals: the curve jumps, and packets need not.
  PacketCluster(std::span<const Receiver> receivers, const GatherRules& rules);

  std::size_t packetCount() const { return packet_count_; }
  // The receivers of packet i, and the places they were given at.
  std::span<const Receiver> receivers(std::size_t i) const {
    return std::span(receivers_).subspan(i * kPacketReceivers, packetSize(i));
  }
  std::span<const std::uint16_t> places(std::size_t i) const {
    return std::span(places_).subspan(i * kPacketReceivers, packetSize(i));
  }
  const PacketView& packet(std::size_t i) const { return packets_[i]; }
  // Wider packets are to be divided.
  float mostPacketRadius() const { return most_packet_radius_; }
  // What packet i looks at by itself.
  CutRegion regionOf(std::size_t i) const {
    return shares(i) ? region(CutRegion::Part::kNear) : CutRegion();
  }

  // Whether some packets share their far field, and packet i is one of them.
  bool shares() const { return sharing_ != 0; }
  bool shares(std::size_t i) const { return (sharing_ >> i & 1) != 0; }
  // Of those that share: the walk of their far field.
  const PacketView& view() const { return view_; }
  CutRegion farRegion() const { return region(CutRegion::Part::kFar); }
  // One for every packet: where the far field is seen from.
  std::span<const Receiver> centres() const { return std::span(centres_).first(packet_count_); }
  // All that is shared is at least so far from the packets that share it.
  float farDistance() const { return limit_ - view_.radius; }

 private:
  std::size_t packetSize(std::size_t i) const {
    return std::min(kPacketReceivers, receiver_count_ - i * kPacketReceivers);
  }
  CutRegion region(CutRegion::Part part) const { return {part, view_, limit_}; }

  std::size_t receiver_count_, packet_count_ = 0;
  std::array<Receiver, kClusterReceivers> receivers_;  // packet by packet
  std::array<std::uint16_t, kClusterReceivers> places_;
  std::array<PacketView, kClusterPackets> packets_;
  std::array<Receiver, kClusterPackets> centres_;
  PacketView view_;
  std::uint32_t sharing_ = 0;
  float limit_ = 0;
  float most_packet_radius_ = 0;
};

}  // namespace surfeit
