// The place being lit, and what is found there.
#pragma once

#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "core/spherical_harmonics.h"

namespace surfeit {

// Consecutive receivers of the order that share one cut. Runs are whole packets, so that packets
// are formed from the order alone.
inline constexpr std::size_t kPacketReceivers = 16;

// Without a normal (zero) it gathers over the whole sphere, every direction with weight 1 instead
// of the cosine; there is no horizon then and no bias.
struct Receiver {
  glm::vec3 position{0};  // finite
  glm::vec3 normal{0};    // unit length or zero
  // For glossy reflection: unit direction that it is looked along; zero: from GatherRules::eye.
  glm::vec3 view{0};

  bool isSpherical() const { return normal == glm::vec3(0); }
};

// Height of a point above the receiver's horizon; infinite for a spherical receiver, which has
// none. `offset` leads from the receiver to the point.
inline float heightAboveHorizon(const Receiver& receiver, const glm::vec3& offset) {
  return receiver.isSpherical() ? std::numeric_limits<float>::infinity()
                                : glm::dot(offset, receiver.normal);
}

// What was gathered at a receiver: GatherOutput has the meanings. What was not asked for is zero.
// Plain floats, so that results can be stored and mixed as such.
struct GatherResult {
  float occlusion = 0;
  glm::vec3 irradiance{0};
  glm::vec3 bent_normal{0};
  glm::vec3 illumination_direction{0};
  glm::vec3 environment{0};
  glm::vec3 fluence{0};
  std::array<glm::vec3, kShCount> radiance_sh{};
};
inline constexpr std::size_t kResultFloats = 16 + 3 * kShCount;
static_assert(sizeof(GatherResult) == kResultFloats * sizeof(float));

}  // namespace surfeit
