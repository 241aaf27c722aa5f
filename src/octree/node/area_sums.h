// Sums over the area of some surfels, of all below a node or of those of one of its facets. In
// double, so that they do not drift; positions relative to an origin, so that nothing cancels.
#pragma once

#include <glm/vec3.hpp>

#include "core/symmetric_matrix.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Of surfels with area A, opacity o, position x relative to an origin, normal n, radiosity B. Plain
// data.
struct AreaSums {
  double area = 0;                                       // sum A
  double position[3] = {};                               // sum A x
  double second_moment[SymmetricMatrix::kEntries] = {};  // sum A (x x^T + what a disk spreads)
  double normal[3] = {};                                 // sum A n over one-sided disks
  double covered[3] = {};                                // sum A o, by color
  double radiosity[3] = {};                              // sum A o B
  double radiosity_sq = 0;                               // sum A o B.B
  double power_normal[3][3] = {};  // sum A o B n over one-sided disks, by color

  AreaSums() = default;
  // One surfel.
  AreaSums(const Surfel& surfel, const double (&origin)[3]);

  // What a change of origin adds: positions are `shift` farther from the new one.
  void move(const double (&shift)[3]);
  void add(const AreaSums& other);

  // |sum A n|.
  double normalLength() const;
  // Mean position, from the origin.
  glm::dvec3 middle() const { return glm::dvec3(position[0], position[1], position[2]) / area; }
  SymmetricMatrix covariance() const;
};

}  // namespace surfeit
