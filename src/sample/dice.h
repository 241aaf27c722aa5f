// Cuts triangles into micropolygons of equal area, the surfels-to-be (memo 08-01, section 3.1).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "sample/meshes/mesh.h"

namespace surfeit {

// A triangular piece of a mesh triangle.
struct Micropolygon {
  glm::dvec3 corner[3];  // world
  glm::dvec3 weight[3];  // the same corners as barycentric weights of the mesh triangle

  glm::dvec3 centroid() const { return (corner[0] + corner[1] + corner[2]) / 3.0; }
  // Of the circle around the centroid that holds the corners.
  double radius() const;
};

// The whole triangle as a piece.
Micropolygon wholeTriangle(const Mesh& mesh, std::uint32_t triangle);

// The piece number `index` of `count` (index < count): cut from the corner opposite the longest
// edge into parts with count / 2 and the rest of the pieces, again and again. All pieces have the
// same area, and hardly any is thinner than the triangle. Costs log2(count) cuts.
Micropolygon piece(Micropolygon polygon, std::uint64_t count, std::uint64_t index);

// The index of the piece of `count` that lies near `target`: where each cut takes the nearer part.
std::uint64_t pieceNear(Micropolygon polygon, std::uint64_t count, const glm::dvec3& target);

// What becomes a surfel: a piece, or a slab of one.
struct PiecePart {
  glm::dvec3 centroid{0};  // world
  glm::dvec3 weight{0};    // the same as barycentric weights of the mesh triangle
  double radius = 0;       // of the circle around the centroid that holds the corners
  double area = 0;
  glm::dvec3 long_side{0};  // of the rectangle of that area that spreads as it does
};

// Appends the piece, of that area, as one part; or when it is a sliver, whose disk would reach far
// beyond its surface, as slabs across its longest edge. A sliver's radius is above 1.5 `spacing`
// and above twice the root of its area; its slabs are at most 2 `spacing` long, which brings the
// radius down to about 1.5, unless that takes more than kMaxSlabs of them.
inline constexpr int kMaxSlabBits = 10;
inline constexpr int kMaxSlabs = 1 << kMaxSlabBits;
void appendParts(const Micropolygon& polygon, double area, double spacing,
                 std::vector<PiecePart>& parts);

// Cuts one triangle into the parts that become its surfels. Immutable; the triangle must outlive
// it.
//
// Triangles at least kStripAspect times as long as high, such as halves of a ribbon's segments, are
// strips: cut across their longest edge into slabs, and those along it into rows, for the pieces of
// piece() would be needles side by side, as long as the triangle, and rectangles instead of them
// would overlap. Others are cut by piece().
class TriangleDice {
 public:
  static constexpr double kStripAspect = 8;

  // `area` is the triangle's, `piece_count` at least 1.
  TriangleDice(const Micropolygon& triangle, double area, std::uint64_t piece_count,
               double spacing);

  // Appends the parts of piece `index` < piece_count, which of a strip may be none.
  void appendParts(std::uint64_t index, std::vector<PiecePart>& parts) const;
  // The index of a piece, with parts, that lies near `target`.
  std::uint64_t pieceNear(const glm::dvec3& target) const;

 private:
  bool isStrip() const { return slabs_ > 0; }

  const Micropolygon& triangle_;
  double area_, spacing_;
  std::uint64_t piece_count_;
  std::uint64_t slabs_ = 0;  // 0: no strip
  int rows_ = 1;
};

// Which surfels a mesh triangle gives.
struct DiceJob {
  std::uint32_t triangle = 0;
  double area = 0;                 // of the triangle
  std::uint64_t piece_count = 0;   // >= 1
  std::uint64_t first_surfel = 0;  // number of its first piece in the whole cloud
  // Triangles too small for surfels of their own that hand this one their area.
  std::vector<std::uint32_t> carried;
};

// All triangles along the Hilbert curve of their centroids, ties in the order of the file.
std::vector<std::uint32_t> trianglesAlongCurve(const Mesh& mesh);

// Shares a number of surfels out to triangles in proportion to area: systematic rounding of the
// summed area, so that the counts add up exactly and never stray by more than one. Triangles are
// taken along the Hilbert curve, so one that is left without a surfel hands its area to the next
// with some, and the cloud comes out coherent. If that one is a spacing away, it hands it to one
// that shares a corner, for otherwise a surface would have a hole there. One thread at a time.
class DicePlan {
 public:
  // `count` >= 1 surfels. The mesh must outlive the plan.
  DicePlan(const Mesh& mesh, std::uint64_t count);

  double totalArea() const { return total_area_; }
  std::uint64_t surfelCount() const { return count_; }
  // Root of the area per surfel.
  double spacing() const;
  // Triangles along the curve.
  const std::vector<std::uint32_t>& order() const { return order_; }

  // The next triangle that has pieces; false at the end.
  bool next(DiceJob& job);

 private:
  std::uint64_t surfelsUpTo(double area) const;
  void findAdopted(const std::vector<bool>& has_surfels);

  const Mesh& mesh_;
  std::uint64_t count_;
  std::vector<std::uint32_t> order_;
  double total_area_ = 0;
  std::uint64_t last_bearer_ = 0;  // position in order_ of the last triangle with pieces
  std::uint64_t cursor_ = 0, carried_begin_ = 0;
  double area_before_ = 0;
  // Those handed to one that shares a corner, by triangles: the latter first
  std::vector<std::pair<std::uint32_t, std::uint32_t>> adopted_;
  std::vector<bool> is_adopted_;  // by triangle
};

}  // namespace surfeit
