#include "octree/neighbours/given_areas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Neighbours that tell how much of a surface is covered: the areas of so many cells of random
// places add up to what they cover within 7 %.
constexpr std::size_t kRun = 64;

// How much of its cell an area covers; 0 of a surfel without an area alone, or off a surface.
float partOf(const Surfel& surfel, const SurfaceAt& cell) {
  const bool is_surface = cell.area > 0 && cell.radius > 0 && cell.thickness <= kLooseThickness;
  return hasAreaAlone(surfel) && is_surface ? surfel.area / cell.area : 0;
}

// The part of the surface that the surfels of a run cover, at most all of it. Strays, whose cells
// reach far, do not count.
float coveredPart(std::span<const Surfel> surfels, std::span<const SurfaceAt> cells) {
  std::array<float, kRun> parts;
  std::size_t count = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const float part = partOf(surfels[i], cells[i]);
    if (part > 0) parts[count++] = part;
  }
  if (count == 0) return 1;
  std::nth_element(parts.begin(), parts.begin() + count / 2, parts.begin() + count);
  const float least = parts[count / 2] / kMostOverArea;
  double given = 0, found = 0;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const float part = partOf(surfels[i], cells[i]);
    if (part == 0 || part < least) continue;
    given += double(surfels[i].area), found += double(cells[i].area);
  }
  return float(std::min(given / found, 1.));
}

void shrink(float part, float area, SurfaceAt& cell) {
  cell.middle *= std::sqrt(part);
  cell.radius *= std::sqrt(part);
  cell.long_side *= std::sqrt(area / cell.area);
  cell.area *= part;
}

}  // namespace

void shrinkToAreas(std::span<const Surfel> surfels, std::span<SurfaceAt> cells) {
  for (std::size_t begin = 0; begin < surfels.size(); begin += kRun) {
    const std::size_t count = std::min(kRun, surfels.size() - begin);
    const std::span<const Surfel> run = surfels.subspan(begin, count);
    const std::span<SurfaceAt> run_cells = cells.subspan(begin, count);
    const float part = coveredPart(run, run_cells);
    for (std::size_t i = 0; i < count; ++i) {
      const float own_part = partOf(run[i], run_cells[i]);
      if (own_part > 0) {
        shrink(std::min(part, kMostOverArea * own_part), run[i].area, run_cells[i]);
      } else {
        run_cells[i] = {};
      }
    }
  }
}

}  // namespace surfeit
