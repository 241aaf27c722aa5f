// The longer side of the piece of surface that a surfel stands for, in three bytes: where it points
// (either way), and how much longer than wide the piece is. Of disks, these bytes tell how many
// surfels share the piece, and how large a tile of a surface each is.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "surfeit/surfel.h"

namespace surfeit {

// Octahedral, 8 bits for each coordinate (Cigolle et al. 2014, "A Survey of Efficient
// Representations for Independent Unit Vectors"): half a degree. Both bytes are 1 to 255, 128 is 0.
inline constexpr std::uint16_t kNoLongSide = 0;

// Whether the bytes hold a direction, which a disk has not.
constexpr bool isDirection(std::uint16_t direction) { return (direction & 0xff) != 0; }
constexpr bool hasLongSide(const Surfel& surfel) { return isDirection(surfel.long_side); }

// Whether a page may hold it: a direction, or a tile's size, or nothing.
constexpr bool isLongSide(std::uint16_t direction) {
  return !isDirection(direction) || direction >> 8 != 0;
}

// The code of a vector of any length; kNoLongSide of what is zero, or nearly, or not finite.
inline std::uint16_t directionCode(const glm::vec3& v) {
  const float sum = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
  if (!(sum > 1e-30f && sum < 1e30f)) return kNoLongSide;
  float x = v.x / sum, y = v.y / sum;
  if (v.z < 0) {
    const float folded_x = std::copysign(1 - std::abs(y), x);
    y = std::copysign(1 - std::abs(x), y);
    x = folded_x;
  }
  const auto byte = [](float coordinate) {
    return static_cast<std::uint32_t>(128 + std::lround(127 * coordinate));
  };
  return static_cast<std::uint16_t>(byte(x) | byte(y) << 8);
}

// Unit; zero of a disk.
inline glm::vec3 directionOf(std::uint16_t code) {
  if (!isDirection(code)) return glm::vec3(0);
  const auto coordinate = [](std::uint32_t byte) {
    return static_cast<float>(static_cast<std::int32_t>(byte) - 128) * (1.0f / 127);
  };
  glm::vec3 v(coordinate(code & 0xffu), coordinate(code >> 8u), 0);
  v.z = 1 - std::abs(v.x) - std::abs(v.y);
  if (v.z < 0) {
    const float unfolded_x = std::copysign(1 - std::abs(v.y), v.x);
    v.y = std::copysign(1 - std::abs(v.x), v.y);
    v.x = unfolded_x;
  }
  return glm::normalize(v);
}

// Elongations are logarithmic, from 1 (code 0) to 251.
inline constexpr float kElongationSteps = 32;  // for a factor of 2

inline float elongationOfCode(std::uint8_t code) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = std::exp2(float(i) / kElongationSteps);
    }
    return values;
  }();
  return table[code];
}
inline std::uint8_t elongationCode(float elongation) {
  if (!(elongation > 1)) return 0;
  const float code = std::round(kElongationSteps * std::log2(elongation));
  return static_cast<std::uint8_t>(std::min(code, 255.f));
}

// Length over width; 1 where the longer side is not known.
inline float elongationOf(const Surfel& surfel) {
  return hasLongSide(surfel) ? elongationOfCode(surfel.elongation) : 1;
}

// Gives a surfel, which has its area, the side as a vector as long as it is.
inline void setLongSide(const glm::vec3& side, Surfel& surfel) {
  surfel.long_side = directionCode(side);
  surfel.elongation = surfel.long_side == kNoLongSide
                          ? std::uint8_t{0}
                          : elongationCode(glm::dot(side, side) / surfel.area);
}

// Where several surfels lie at one place, or nearly, each is a disk as large as the piece around
// them, and has its part of the area: how many they are. Rectangles and spheres are alone.
inline void setSharers(float sharers, Surfel& surfel) {
  if (!hasLongSide(surfel)) surfel.elongation = elongationCode(sharers);
}
inline float sharersOf(const Surfel& surfel) {
  const bool is_shared = surfel.elongation != 0 && !hasLongSide(surfel);
  return is_shared ? elongationOfCode(surfel.elongation) : 1;
}
// Of the piece of surface around it.
inline float pieceArea(const Surfel& surfel) { return surfel.area * sharersOf(surfel); }

// A disk whose neighbours tell that it is a tile of a surface hides all of its cell, which may be
// larger or smaller than its area (by a factor of up to 16, in steps of 2 %).
inline void setTile(float cell_area, Surfel& surfel) {
  if (hasLongSide(surfel)) return;
  const float code = 128 + std::round(kElongationSteps * std::log2(cell_area / surfel.area));
  surfel.long_side = static_cast<std::uint16_t>(std::uint32_t(std::clamp(code, 1.f, 255.f)) << 8u);
}
constexpr bool isTile(const Surfel& surfel) {
  return surfel.long_side != kNoLongSide && !hasLongSide(surfel);
}
// Of the cell of a tile over its area; 1 of what is none.
inline float tileShare(const Surfel& surfel) {
  if (!isTile(surfel)) return 1;
  constexpr float kLeast = 1.f / 16;
  return kLeast * elongationOfCode(static_cast<std::uint8_t>(surfel.long_side >> 8u));
}

// The side as a vector; zero when it is not known.
inline glm::vec3 longSideOf(const Surfel& surfel) {
  return std::sqrt(surfel.area * elongationOf(surfel)) * directionOf(surfel.long_side);
}

}  // namespace surfeit
