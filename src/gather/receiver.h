// The place being lit, and what is found there.
#pragma once

#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace surfeit {

// Consecutive receivers of the order that share one cut. Runs are whole packets, so that packets
// are formed from the order alone.
inline constexpr std::size_t kPacketReceivers = 16;

// Without a normal (zero) it gathers over the whole sphere, every direction with weight 1 instead
// of the cosine; there is no horizon then and no bias.
struct Receiver {
  glm::vec3 position{0};  // finite
  glm::vec3 normal{0};    // unit length or zero

  bool isSpherical() const { return normal == glm::vec3(0); }
};

// Height of a point above the receiver's horizon; infinite for a spherical receiver, which has
// none. `offset` leads from the receiver to the point.
inline float heightAboveHorizon(const Receiver& receiver, const glm::vec3& offset) {
  return receiver.isSpherical() ? std::numeric_limits<float>::infinity()
                                : glm::dot(offset, receiver.normal);
}

struct GatherResult {
  // Covered part of the hemisphere by cosine, or of the sphere; 0..1.
  float occlusion = 0;
  // With kBleeding, E = pi * mean radiance = mean radiosity, by the same weights; else zero.
  glm::vec3 irradiance{0};
};

}  // namespace surfeit
