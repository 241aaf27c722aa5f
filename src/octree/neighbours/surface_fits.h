// Planes, and low quadrics over them, through the neighbours of many places at once: a place in
// each lane, so that every place gets the same sums whatever the instruction set, and whatever
// places are beside it.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include "octree/neighbours/places.h"

namespace surfeit {

// Neighbours that lie farther off their plane than this, in spacings, lie all around; those of a
// surface with noise of half a spacing lie half a spacing off.
inline constexpr float kThinThickness = 0.75f;

// By lane; lengths are in units of the farthest neighbour: fourth powers of them must stay finite.
struct SurfaceFitLanes {
  static constexpr std::size_t kLanes = 16, kMostNeighbours = 112;
  // How far an open cell reaches.
  static constexpr float kOpen = 2;
  using Lanes = float[kLanes];

  // Given
  std::size_t most_neighbours = 0;  // of any lane
  alignas(64) Lanes count;          // of neighbours
  Lanes unit;                       // distance of the farthest neighbour
  Lanes own_x, own_y, own_z;        // the place's own normal; zero: becomes that of the plane
  bool with_quadrics = false;       // whether quadrics are fitted

  // Found
  alignas(64) Lanes normal_x;  // of the plane
  Lanes normal_y, normal_z;
  Lanes thickness;   // root mean square of what lies off the plane
  Lanes confidence;  // 1 - 3 l0 / (l0 + l1 + l2), with the variances along its axes
  Lanes is_line;     // 1: the neighbours lie on one, and the plane is any through it
  Lanes surface_x, surface_y, surface_z;  // the normal of the quadric at the place
  Lanes highest;                          // the most that a neighbour lies off the own plane

  // By neighbour: offsets, given, in any unit; then in the own plane's frame, and above it
  alignas(64) Lanes x[kMostNeighbours];
  Lanes y[kMostNeighbours], z[kMostNeighbours];
  Lanes beside_u[kMostNeighbours], beside_v[kMostNeighbours], above[kMostNeighbours];
  Lanes weight[kMostNeighbours];  // scratch

  // Cells: half the squared distance beside the place, of neighbours that count (others: infinity),
  // below which they share the cell
  Lanes half_sq[kMostNeighbours];
  Lanes coincident_half_sq;
  // Found
  Lanes surface_height;  // of the sheet that the place scatters about, above it
  Lanes cell_area;
  Lanes cell_middle_u, cell_middle_v;
  Lanes cell_square, cell_difference, cell_product;  // CellMoments::fromPlace
  Lanes cell_reach_sq;                               // of the farthest corner
  Lanes cell_sharers;  // the place, and neighbours that share the cell
  Lanes cell_is_cut;   // 1: by any neighbour
};

struct SurfaceFitKernel {
  // Planes and quadrics, and the neighbours in the own planes' frames.
  void (*fit)(SurfaceFitLanes& lanes);
  // Then the cells of neighbours that count, and the surfaces that these scatter about.
  void (*measure)(SurfaceFitLanes& lanes);
};

const SurfaceFitKernel& fastestSurfaceFitKernel();
// Of all instruction sets that this machine has.
std::span<const SurfaceFitKernel> surfaceFitKernels();

}  // namespace surfeit
