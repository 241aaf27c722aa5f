// Tells of positions that are far from all others: errors of a scanner, mostly, which make a scene
// large and its index slow.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "core/bounds.h"

namespace surfeit {

// The box that holds 98 % of the places along each axis; all of few. At least one place, whose
// order changes.
Bounds3d usualBounds(std::vector<glm::vec3>& sample);

// A sentence with the command that leaves strays out, when 98 % of `sample`, positions from all
// over a cloud with these bounds, lie in a box of a thousandth of the cloud's width; else nothing.
// All are counted from `origin`.
std::string strayNote(std::vector<glm::vec3> sample, const Bounds3& bounds,
                      const glm::dvec3& origin);

// A sentence when strays put the origin so far away from the others that floats about it round
// their positions, beside the spacing of `count` surfels. It advises --origin where that
// `is_origin_asked`.
std::string lossByStrays(std::vector<glm::vec3> sample, const Bounds3& bounds,
                         const glm::dvec3& origin, std::uint64_t count, bool is_origin_asked);

// A sentence when the surfels lie in places so far apart that floats about one origin round the
// positions of more than one in a hundred of `sample`, beside the spacing of `count` surfels, where
// no strays are to blame.
std::string lossByDistance(const std::vector<glm::vec3>& sample, const Bounds3& bounds,
                           const glm::dvec3& origin, std::uint64_t count);

}  // namespace surfeit
