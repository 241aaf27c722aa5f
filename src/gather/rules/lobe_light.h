// What a surfel or a flat piece of a node with a lobe (octree/node/lobe.h) sends in a direction.
// docs/many_gathers.md, "Glossy bounces".
#pragma once

#include <glm/vec3.hpp>

#include "octree/node/lobe.h"

namespace surfeit {

// A lobe on a surface, ready for many directions. Plain data.
struct LobeLight {
  glm::vec3 axis{0, 0, 1};  // unit
  float concentration = 0;  // k of the von Mises-Fisher distribution, above 0
  glm::vec3 shares{0};      // of the radiosity that it sends, by color
  float facing = 1;         // the integral of the distribution times the cosine above the surface

  LobeLight() = default;
  // `normal`: of the surface, unit.
  LobeLight(const Lobe& lobe, const glm::vec3& normal);

  // How many times as much as if it were sent evenly goes in this direction, unit, of what is sent
  // in the lobe. `spread`: the variance along each axis of the directions to the receiver from all
  // of what sends, below 1. Over the hemisphere above the surface the mean, weighted by the cosine,
  // is 1 within 2 % without spread; less where the lobe lies along the surface. Never negative.
  float gain(const glm::vec3& direction, float spread) const;

  // The part of the radiosity that a receiver in this direction sees.
  glm::vec3 part(const glm::vec3& direction, float spread) const {
    return 1.f + shares * (gain(direction, spread) - 1);
  }
};

}  // namespace surfeit
