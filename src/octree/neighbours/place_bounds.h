// Where the places of a subtree lie, and how they face.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace surfeit {

// Places within `radius` of `centre`. Their normals are within the angle with cosine
// `normal_cosine` of `normal`, which is unit; -1: any.
struct PlaceBounds {
  glm::vec3 centre{0};
  float radius = 0;
  glm::vec3 normal{0};
  float normal_cosine = -1;

  // The greatest cosine between some normal of theirs and a unit direction.
  float mostCosine(const glm::vec3& direction) const {
    const float cosine = glm::dot(normal, direction);
    if (cosine >= normal_cosine) return 1;
    const auto sine = [](float c) { return std::sqrt(std::max(0.f, 1 - c * c)); };
    return cosine * normal_cosine + sine(cosine) * sine(normal_cosine);
  }
};

}  // namespace surfeit
