// How the radiosity of a flat piece follows the direction in which its surfels face, and how pages
// store it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "octree/node/area_sums.h"

namespace surfeit {

// Of a flat node or a facet with the mean normal N and the range r of its normals (normalRange), by
// color: r slope / 3 is the part across N of the mean of the normals weighted by power. So it is
// where a surfel with the normal n is 1 + slope . (n - N) / r times as bright as the mean of the
// piece. Lit from one side, a curved piece is brighter where it faces that side, and looks so from
// there.
struct RadiositySlope {
  // No slope is steeper along an axis: from 1 on, a part of the piece is dark.
  static constexpr float kMost = 2;
  // The least square of r of pieces with a slope: what steps of 1/32767 leave unknown of 1 - N.N,
  // times 3/2.
  static constexpr double kLeastRangeSq = 3. / 32767;
  static constexpr std::size_t kCodes = 9;  // x, y, z of red, of green, of blue
  std::array<std::int8_t, kCodes> codes{};  // in 1/127 of kMost

  // None in a color in which the piece does not shine, or where it is as good as plane.
  static RadiositySlope of(const AreaSums& piece);
  // The same of a piece that may be turned the other way than `normal`, as two-sided ones may.
  static RadiositySlope towards(const glm::vec3& normal, const AreaSums& piece);

  bool isNone() const { return codes == std::array<std::int8_t, kCodes>{}; }
  glm::vec3 value(std::size_t color) const {
    const std::int8_t* const code = &codes[3 * color];
    return glm::vec3(code[0], code[1], code[2]) * (kMost / 127);
  }
  // Of the piece with the opposite normal.
  RadiositySlope turned() const {
    RadiositySlope turned;
    for (std::size_t i = 0; i < kCodes; ++i) turned.codes[i] = std::int8_t(-codes[i]);
    return turned;
  }
  bool operator==(const RadiositySlope&) const = default;
};

}  // namespace surfeit
