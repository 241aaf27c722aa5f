// The rectangles that surfels stand for of which the longer side is known: pieces of hair and
// grass, places on the lines of a scan. Their disks would cover, thinly, several times their width.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/long_side.h"
#include "core/symmetric_matrix.h"
#include "surfeit/surfel.h"

namespace surfeit {

struct Ribbon {
  glm::vec3 along{0}, across{0};  // unit, in the plane of the surfel
  float length = 0, width = 0;    // 0: the surfel is a disk
  bool isEmpty() const { return length == 0; }

  static Ribbon of(const Surfel& surfel) {
    Ribbon ribbon;
    if (!hasLongSide(surfel) || surfel.isSphere()) return ribbon;
    const glm::vec3 side = directionOf(surfel.long_side);
    const glm::vec3 in_plane = side - glm::dot(side, surfel.normal) * surfel.normal;
    const float cosine = glm::length(in_plane);
    if (!(cosine > kLeastInPlane)) return ribbon;
    ribbon.along = in_plane / cosine;
    ribbon.across = glm::cross(surfel.normal, ribbon.along);
    ribbon.length = std::sqrt(surfel.area * std::max(elongationOf(surfel), kLeastElongation));
    ribbon.width = surfel.area / ribbon.length;
    return ribbon;
  }

  // Of the circle around it.
  float radius() const { return 0.5f * std::sqrt(length * length + width * width); }

  // How it spreads, as Patch::shape.
  SymmetricMatrix shape() const {
    const float scale = 2 / (length * length + width * width);
    const float u = scale * length * length, v = scale * width * width;
    SymmetricMatrix sum;
    for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
      const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
      sum.entries[i] = u * along[row] * along[column] + v * across[row] * across[column];
    }
    return sum;
  }

  // The mean of x x^T over it, from its middle.
  SymmetricMatrix spread() const { return ((length * length + width * width) / 24) * shape(); }

  // The same, of the shape, the area and the width.
  static Ribbon ofShape(const SymmetricMatrix& shape, const glm::vec3& normal, float area,
                        float width) {
    Ribbon ribbon;
    ribbon.length = area / width;
    ribbon.width = width;
    const float across_part = 2 * width * width / (ribbon.length * ribbon.length + width * width);
    const SymmetricMatrix plane = withoutDirection(normal);
    // What is left is a multiple of along along^T: its longest column is the most exact
    SymmetricMatrix rest;
    for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
      rest.entries[i] = shape.entries[i] - across_part * plane.entries[i];
    }
    int longest = 0;
    for (int i = 1; i < 3; ++i) longest = rest(i, i) > rest(longest, longest) ? i : longest;
    ribbon.along = glm::normalize(glm::vec3(rest(0, longest), rest(1, longest), rest(2, longest)));
    ribbon.across = glm::cross(normal, ribbon.along);
    return ribbon;
  }

 private:
  // A side that is nearly the normal says nothing, by a code of half a degree; squares have no
  // axes.
  static constexpr float kLeastInPlane = 0.1f, kLeastElongation = 1.01f;
};

}  // namespace surfeit
