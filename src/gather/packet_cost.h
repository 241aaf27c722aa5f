// What a packet costs by its width, foreseen from the cut of one receiver. A wide packet opens what
// is near to any of its receivers, so scattered receivers are cheaper in narrow packets or alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "gather/receiver.h"
#include "octree/node.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Visits the cut of a receiver (CutWalk), then answers. One thread at a time.
class PacketCost {
 public:
  // Room for the nodes of a cut; more for larger ones, as PacketRaster.
  static constexpr std::size_t kReservedNodes = 4096;
  PacketCost();

  // Starts over for a receiver here.
  void begin(const glm::vec3& position);
  void node(const Node& node);
  void leaf(const Node& node) { single_surfels_ += float(node.surfel_count); }
  void surfels(std::span<const Surfel>) {}

  // About how many patches a packet of this radius around the receiver draws. A node of s surfels
  // at distance d is seen from d - radius at nearest, and gives way to about (d / (d - radius))^2
  // smaller ones, at most to its surfels.
  float patches(float radius) const;

  static constexpr std::size_t memoryBytes() { return kReservedNodes * 2 * sizeof(float); }

  // Whether receivers of a packet draw less in halves (firstHalf), or parts of these, than
  // together.
  bool isBetterDivided(std::span<const Receiver> packet) const;

 private:
  float leastPatches(std::span<const Receiver> packet) const;

  glm::vec3 position_{0};
  float single_surfels_ = 0;
  std::vector<float> distances_, surfel_counts_;  // of the nodes
};

}  // namespace surfeit
