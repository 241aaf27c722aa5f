// Surfels on the shapes of random scenes, sampled as differently as those of meshes and scans are.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "random/random_numbers.h"
#include "random/random_shapes.h"
#include "surfeit/surfel.h"

namespace surfeit {

// How surfels stand for a surface.
struct SamplingLook {
  bool is_two_sided = false;
  double jitter = 0;            // of places, in cells
  bool is_scattered = false;    // anywhere: some cells have several, some none
  double position_noise = 0;    // along the normal, in spacings
  double normal_noise = 0;      // radians, about
  bool radius_by_area = false;  // sqrt(2 A / pi) instead of the circle around the cell
  glm::dvec3 color{0};
  glm::dvec3 waves{0};  // of the color, along the axes; 0: one color

  std::string describe() const;
};

SamplingLook randomLook(bool may_be_two_sided, RandomNumbers& random);

// A place on a surface, in the units of the shapes.
struct SurfaceSite {
  glm::dvec3 position{0}, normal{0};
  double spacing = 0;         // of the surfels there
  bool is_on_border = false;  // of the patch
};

// A patch as a grid of cells with flat middles; each is a surfel, and two true triangles.
class CellGrid {
 public:
  CellGrid(const ShapePatch& patch, int columns, int rows);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  glm::dvec3 corner(int column, int row) const {
    return corners_[std::size_t(row) * std::size_t(columns_ + 1) + std::size_t(column)];
  }
  // On the two triangles that the cell is, cut from its first corner to its last; s and t in 0..1.
  SurfaceSite site(int column, int row, double s, double t) const;
  double cellArea(int column, int row) const;
  double cellRadius(int column, int row) const;  // of the circle around its middle

 private:
  int columns_, rows_;
  std::vector<glm::dvec3> corners_;
};

// A surfel in doubles, in the units of the shapes.
struct SampledSurfel {
  glm::dvec3 position{0}, normal{0}, radiosity{0}, long_side{0};
  double radius = 0, area = 0;
  bool is_two_sided = false;
};

void sampleGrid(const CellGrid& grid, const SamplingLook& look, RandomNumbers& random,
                std::vector<SampledSurfel>& surfels);
void sampleLeaf(const ShapeLeaf& leaf, const SamplingLook& look,
                std::vector<SampledSurfel>& surfels);
void samplePoint(const ShapePoint& point, const SamplingLook& look,
                 std::vector<SampledSurfel>& surfels);

}  // namespace surfeit
