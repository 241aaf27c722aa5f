// The lobe (octree/node/lobe.h) of a surfel or a flat piece of a node, of which packet_lobe-inl.h
// tells what receivers see. docs/many_gathers.md, "Glossy bounces".
#pragma once

#include <glm/vec3.hpp>

#include "octree/node/lobe.h"

namespace surfeit {

// A lobe on a surface, ready for many directions. Plain data.
struct LobeLight {
  glm::vec3 axis;       // unit
  float concentration;  // k of the von Mises-Fisher distribution, above 0
  glm::vec3 shares;     // of the radiosity that it sends, by color
  float facing;         // the integral of the distribution times the cosine above the surface

  // `normal`: of the surface, unit.
  LobeLight(const Lobe& lobe, const glm::vec3& normal);
};

}  // namespace surfeit
