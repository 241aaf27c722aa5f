// Surfels of the surfaces of generated scenes: a surface with n surfels is divided into n cells
// (core/square_strata.h), and a surfel is one cell, with its albedo and the light of sun and sky
// that it sends on; nothing casts shadows.
#pragma once

#include <cstdint>

#include "surfeit/surfel.h"
#include "surfels/generated/scene_surfaces.h"

namespace surfeit {

// How a surface is divided. All functions here are safe from any thread.
struct SurfaceShare {
  std::uint64_t key = 0;    // of the surface's random numbers
  std::uint64_t count = 0;  // its surfels
  std::uint64_t rows = 0;   // cellRows(surface, count)
  double mean_area = 0;     // of a surfel, m^2
};

// Rows of cells for `count` > 0 surfels, about square; of haze the number of layers.
std::uint64_t cellRows(const Surface& surface, std::uint64_t count);

// Surfel `index` of the share: its radius circumscribes its cell, and areas average `mean_area`.
Surfel makeSurfaceSurfel(const Surface& surface, const SurfaceShare& share, std::uint64_t index);

}  // namespace surfeit
