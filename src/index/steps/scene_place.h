// Where the positions of a scene are counted from, and the cube that its octree divides.
#pragma once

#include <glm/vec3.hpp>

#include "core/bounds.h"
#include "surfeit/index.h"

namespace surfeit {

// The origin for a cloud of these bounds, which are counted from `present`. Bounds about a far
// origin are rough: they may ask for another one again when they are counted from this one.
glm::dvec3 originAsked(const IndexOptions& options, const Bounds3& bounds,
                       const glm::dvec3& present);

// The root cube for a cloud of these bounds, both about `origin`.
RootCube cubeAsked(const IndexOptions& options, const Bounds3& bounds, const glm::dvec3& origin);

}  // namespace surfeit
