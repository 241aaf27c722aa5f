// Disks of surfels that come with an area and without a radius: the area stays, the neighbours tell
// where the disk lies and how far it reaches (docs/surfels.md, "Sizes from the neighbourhood").
#pragma once

#include <span>

#include "octree/neighbours/surface_search.h"
#include "octree/page/surfel_marks.h"
#include "surfeit/surfel.h"

namespace surfeit {

// What index finds of a surfel as its file has it, and of one with marks (applySizeRules()). A file
// that has the shape, and tiny areas, which would pass for placeholders, tell the radius.
inline bool findsRadius(const Surfel& surfel) {
  return surfel.radius <= 0 && surfel.area > kPlaceholderSize && surfel.long_side == 0;
}
inline bool hasAreaAlone(const Surfel& surfel) {
  return (surfel.flags & kSurfelNeedsSize) != 0 && surfel.radius <= kPlaceholderSize &&
         surfel.area > kPlaceholderSize;
}

// One in 100,000 cells of random places is larger than 5 times the mean (Ferenc and Neda 2007, "On
// the size distribution of Poisson Voronoi cells"). A cell that exceeds a surfel's area by more
// holds something else, too, or nothing: it counts no further, and so does a disk.
inline constexpr float kMostOverArea = 5;

// Shrinks the cells of surfels with an area alone, about their places, to as much of the surface
// as the areas cover, with the longer side of a piece of the area; of those that lie on no surface,
// to nothing. In runs of neighbours along the curve, from the first surfel on.
void shrinkToAreas(std::span<const Surfel> surfels, std::span<SurfaceAt> cells);

}  // namespace surfeit
