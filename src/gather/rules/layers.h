// Sheets close behind each other that face alike, as a rug on a floor: what is hidden behind
// another is not drawn, for distances within a pixel do not tell which is in front.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "octree/node/node.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Whether a flat node, or a facet of another one, has a hidden side.
bool hasHiddenPieces(const Node& node);

// The part of it that an eye sees, 0 to 1: nothing of a hidden side, but all where the eye may lie
// between the layers. Of a flat node or its facet i; and of a surfel.
float seenOfPiece(const Node& node, std::size_t i, const glm::vec3& eye);
float seenOf(const Surfel& surfel, const glm::vec3& eye);

}  // namespace surfeit
