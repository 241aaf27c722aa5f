// The place being lit, as the gather has it: in floats, about the origin of the scene.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "core/spherical_harmonics.h"
#include "surfeit/gather.h"

namespace surfeit {

// Consecutive receivers of the order that share one cut. Runs are whole packets, so that packets
// are formed from the order alone.
inline constexpr std::size_t kPacketReceivers = 16;

// Without a normal (zero) it gathers over the whole sphere, every direction with weight 1 instead
// of the cosine; there is no horizon then and no bias.
struct LocalReceiver {
  glm::vec3 position{0};  // finite
  glm::vec3 normal{0};    // unit length or zero
  // For glossy reflection: unit direction that it is looked along; zero: from GatherRules::eye.
  glm::vec3 view{0};

  bool isSpherical() const { return normal == glm::vec3(0); }
};

// Results are plain floats, so that they can be stored and mixed as such.
inline constexpr std::size_t kResultFloats = 16 + 3 * kShCount;
static_assert(sizeof(GatherResult) == kResultFloats * sizeof(float));

}  // namespace surfeit
