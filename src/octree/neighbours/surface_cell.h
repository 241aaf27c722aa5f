// The piece of a surface that is nearer to a place than to its neighbours: the place's cell of
// their Voronoi diagram, in the plane that touches the surface there. What clouds without areas are
// given (docs/format.md, "Rules for what is missing").
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

namespace surfeit {

// Another place, from the one in question.
struct Neighbour {
  glm::vec3 offset{0};
  glm::vec3 normal{0};   // zero: none
  std::uint64_t id = 0;  // of the surfel, or the first one there (places.h)
};

struct SurfaceCell {
  float area = 0;        // 0: the neighbours do not tell
  float radius = 0;      // of the disk around the place that is spread out as far: the same second
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

// One thread at a time: it keeps memory, and the cell that it made last.
class SurfaceCells {
 public:
  SurfaceCells();
  SurfaceCells(SurfaceCells&&) noexcept;
  SurfaceCells& operator=(SurfaceCells&&) noexcept;
  ~SurfaceCells();

  // `neighbours`: all that are nearer than `reach`, ascending; none at the place itself. `normal`:
  // of the place; zero: that of the plane through all. Neighbours on another sheet (turned away, or
  // above or below with nothing between) do not count.
  SurfaceCell cellOf(std::span<const Neighbour> neighbours, float reach, const glm::vec3& normal);

  // A cell that is not settled may be cut by places farther away. Whether any could, which would be
  // nearer than reach(): a place, or one within a sphere.
  bool isOpen() const;
  float reach() const;
  bool mayCut(const glm::vec3& centre, float radius) const;
  bool wouldCut(const Neighbour& place) const;
  // False when it does not after all.
  bool cut(const Neighbour& place);

  // The cell when nothing else cuts it: where it is still open, at the edge of a surface, it is
  // closed by the mirror images of the places that cut it. `neighbours` as before.
  SurfaceCell closed(std::span<const Neighbour> neighbours);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace surfeit
