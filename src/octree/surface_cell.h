// The piece of a surface that is nearer to a place than to its neighbours: the place's cell of
// their Voronoi diagram, in the plane that touches the surface there. What clouds without areas are
// given (docs/format.md, "Rules for what is missing").
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <span>

namespace surfeit {

// Another place, from the one in question.
struct Neighbour {
  glm::vec3 offset{0};
  glm::vec3 normal{0};  // zero: none
};

struct SurfaceCell {
  float area = 0;    // 0: the neighbours do not tell
  float radius = 0;  // of the disk around the place that is spread out as far: the same second
                     // moment over its area
  glm::vec3 normal{0};   // of the plane through them, either way
  float confidence = 0;  // 1 - 3 l0 / (l0 + l1 + l2), with the variances along its axes
  bool is_line = false;  // the neighbours lie on one: any plane through it will do
  // Whether places beyond the last neighbour would not change it.
  bool is_settled = false;
  // How far they lie off that plane, root mean square, over the spacing: about 1 all around.
  float thickness = 0;
  // Of cells that stay open: how far the neighbours are from each other.
  float neighbour_spacing = 0;
};

// One thread at a time: it keeps memory between calls.
class SurfaceCells {
 public:
  SurfaceCells();
  SurfaceCells(SurfaceCells&&) noexcept;
  SurfaceCells& operator=(SurfaceCells&&) noexcept;
  ~SurfaceCells();

  // `neighbours`: all that are nearer than `reach`, ascending; none at the place itself. `normal`:
  // of the place; zero: that of the plane through all. Neighbours on another sheet (turned away, or
  // above or below with nothing between) do not count. With `is_last` there will be no more of
  // them: a cell that is open, at the edge of a surface, is closed by their mirror images.
  SurfaceCell cellOf(std::span<const Neighbour> neighbours, float reach, const glm::vec3& normal,
                     bool is_last);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace surfeit
