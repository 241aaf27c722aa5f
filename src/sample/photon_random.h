// Random numbers and directions of photons.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/spherical_harmonics.h"
#include "core/split_mix.h"
#include "core/tangent_frame.h"

namespace surfeit {

// Random numbers of one photon (SplitMix64).
class PhotonRandom {
 public:
  PhotonRandom(std::uint64_t seed, std::uint64_t photon)
      : state_(splitMix(splitMix(seed) + photon)) {}

  // In [0, 1).
  float next() {
    state_ += 0x9e3779b97f4a7c15u;
    return float(splitMix(state_) >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_;
};

// Uniform on the unit disk.
inline glm::vec2 diskPoint(PhotonRandom& random) {
  const float r = std::sqrt(random.next()), phi = 2 * kPi * random.next();
  return {r * std::cos(phi), r * std::sin(phi)};
}

// Around a unit normal, with density cos / pi: lifted from the disk.
inline glm::vec3 cosineDirection(const glm::vec3& normal, PhotonRandom& random) {
  const glm::vec2 p = diskPoint(random);
  const TangentFrame frame(normal);
  const float cos_theta = std::sqrt(std::max(0.0f, 1 - p.x * p.x - p.y * p.y));
  return glm::normalize(frame.tangent * p.x + frame.bitangent * p.y + normal * cos_theta);
}

inline glm::vec3 sphereDirection(PhotonRandom& random) {
  const float z = 1 - 2 * random.next(), phi = 2 * kPi * random.next();
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace surfeit
