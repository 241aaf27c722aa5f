// What the readers of curves in Houdini's geometry of version 5 share, binary and text.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cloud/houdini/bgeo_curves.h"
#include "cloud/rows/row_layout.h"
#include "surfeit/status.h"

namespace surfeit {

enum class GeoType : std::uint32_t { kPoly = 1, kNurbs = 2, kBezier = 4, kParticles = 0x8000 };

// How many knots a file has of a curve; 0 for what no curve is.
inline std::size_t geoKnotCount(const HoudiniBasis& basis, std::size_t vertices, bool is_closed) {
  const std::size_t order = basis.order;
  if (order < 2 || vertices == 0) return 0;
  if (basis.kind == HoudiniBasis::Kind::kBezier) {
    return (vertices - (is_closed ? 0 : 1)) / (order - 1) + (is_closed ? 0 : 1);
  }
  if (!basis.has_ends) return vertices + order - 2;
  return vertices + (is_closed ? 3 : 2) < order ? 0 : vertices + (is_closed ? 3 : 2) - order;
}

// The advice for what cannot be passed over.
inline Status unknownGeoPrimitive(const std::string& path, std::uint64_t offset,
                                  std::string_view type) {
  return Status::corruption(fmt::format(
      "{}: byte {}: a primitive of type {}, expected polygons, NURBS or Bezier curves, or "
      "particles: keep the curves alone (Delete or Blast in Houdini), or save .bgeo of Houdini 12 "
      "or later, where others are passed over",
      path, offset, type));
}

// Takes a primitive of `vertices`, points of the file.
inline void addGeoCurve(GeoType type, bool is_closed, HoudiniBasis basis,
                        const std::vector<std::uint32_t>& vertices, HoudiniCurves& curves) {
  if (type == GeoType::kParticles) {
    ++curves.others["Part"];
    return;
  }
  if (is_closed) {
    ++curves.closed_polygons;
    return;
  }
  curves.corners.push_back(static_cast<std::uint32_t>(vertices.size()));
  curves.points.insert(curves.points.end(), vertices.begin(), vertices.end());
  curves.addBasis(std::move(basis));
}

}  // namespace surfeit
