// Polygons into triangles.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace surfeit {

// Appends the triangles that cover the polygon with those corners, convex or not, flat or nearly,
// as indices into `corners`; all turn the way that the polygon does. Convex polygons become the fan
// of their first corner, others lose one ear after the other (Meisters 1975). Edges may touch, as
// where a hole is joined to its outline. False when edges cross: then something is covered twice,
// or not at all.
bool cutPolygon(std::span<const glm::dvec3> corners, std::vector<glm::uvec3>& triangles);

}  // namespace surfeit
