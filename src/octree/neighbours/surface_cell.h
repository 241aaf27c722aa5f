// The piece of a surface that is nearer to a place than to its neighbours: the place's cell of
// their Voronoi diagram, in the plane that touches the surface there. What clouds without areas are
// given (docs/format.md, "Rules for what is missing").
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include "octree/neighbours/place_bounds.h"

namespace surfeit {

// Another place, from the one in question.
struct Neighbour {
  glm::vec3 offset{0};
  glm::vec3 normal{0};   // zero: none
  std::uint64_t id = 0;  // of the surfel, or the first one there (places.h)
};

struct CellPlace {
  // All that are nearer than `reach`, ascending; none at the place itself.
  std::span<const Neighbour> neighbours;
  float reach = 0;
  glm::vec3 normal{0};  // of the place; zero: that of the plane through all
};

struct SurfacePlane {
  glm::vec3 normal{0};   // of the surface through the neighbours at the place, either way
  float confidence = 0;  // 1 - 3 l0 / (l0 + l1 + l2), with the variances along the plane's axes
  bool is_line = false;  // the neighbours lie on one: any plane through it will do
  // How far they lie off that plane, root mean square, over the spacing: about 1 all around.
  float thickness = 0;
};

struct SurfaceCell {
  float area = 0;       // per surfel that shares it; 0: the neighbours do not tell
  float sharers = 1;    // the place, and others nearly there
  float radius = 0;     // of the disk around the place that is spread out as far: the same second
                        // moment over its area
  glm::vec3 middle{0};  // from the place
  // Of the rectangle around the middle that is spread out as far, where it is much longer than
  // wide; else zero.
  glm::vec3 long_side{0};
  // Whether places beyond the last neighbour would not change it.
  bool is_settled = false;
  // Of cells that stay open: how far the places that cut them are from others of the sheet.
  float neighbour_spacing = 0;
  // As of SurfacePlane, of the place's own sheet where normals tell it from others; else negative.
  float sheet_thickness = -1;
  // Whether it may be one of many leaves and no sheet: neighbours that face elsewhere lie on both
  // sides of it, or hardly any are on it.
  bool is_lone = false;
};

// One thread at a time: it keeps memory, and the cell that it made last.
class SurfaceCells {
 public:
  SurfaceCells();
  SurfaceCells(SurfaceCells&&) noexcept;
  SurfaceCells& operator=(SurfaceCells&&) noexcept;
  ~SurfaceCells();

  // Up to SurfaceFitLanes::kLanes places, the lanes of the other functions; their neighbours must
  // stay. Without `with_normals` a plane's normal is that of the plane, not of the surface.
  void fit(std::span<const CellPlace> places, bool with_normals);
  SurfacePlane planeOf(std::size_t lane) const;
  // Finds the cells of all of them at once, of those that nothing farther away can cut. Of many
  // neighbours, or for one place, they are found faster one by one.
  void measure();
  // After measure(): from the place to the surface that its sheet scatters about, along its normal.
  // Zero where places do not scatter.
  glm::vec3 heightOf(std::size_t lane) const;
  // Neighbours on another sheet (turned away, or above or below with nothing between) do not count.
  SurfaceCell cellOf(std::size_t lane);

  // A cell that is not settled may be cut by places farther away. Whether any could, which would be
  // nearer than reach(): a place, or one within bounds.
  bool isOpen() const;
  float reach() const;
  // Whether places close by cannot tell the size of the cell.
  bool isSparse();
  // Whether all that cuts the cell is much farther away than places all around that face elsewhere.
  bool isLost() const;
  // Whether one or two places cut the cell from much closer than all others: a row of a scan.
  bool isOnRow() const;
  // Opens the cell that was closed last, to be cut by places farther than twice the last neighbour,
  // up to twice `radius`. False where these are not needed.
  bool widen(float radius);
  // From the place.
  glm::vec3 farthestCorner() const;
  bool mayCut(const PlaceBounds& bounds) const;
  bool wouldCut(const Neighbour& place) const;
  // False when it does not after all.
  bool cut(const Neighbour& place);

  // The places at the sides of the cell; and whether another place is on the sheet of one of them.
  // Offsets are from the place.
  std::span<const Neighbour> cutters();
  bool isBeside(const Neighbour& place, const Neighbour& other) const;

  // Begins the cell again, cut by what cutters() found. The dense ones of these end it where they
  // are, the nearest first; what lies beyond an end does not count. The number of ends.
  std::size_t endAt(std::span<const Neighbour> dense);

  // The cell when what is farther away is no guide: among the nearest of the own sheet, or a square
  // as wide as the spacing of all neighbours, where hardly any are on that.
  SurfaceCell cellOfNearest();

  // The cell when nothing else cuts it: where it is still open, at the edge of a surface, it is
  // closed by the mirror images of the places that cut it.
  SurfaceCell closed();
  // The same of a widened cell, which is settled where places lie all around it, however far.
  SurfaceCell closedWide();

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace surfeit
