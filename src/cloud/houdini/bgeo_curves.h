// The curves of Houdini's geometry since version 12, binary JSON, which stand beside its points
// (cloud/houdini/bgeo_json_reader.h):
//
//   [ ..., "pointcount", n, ...,
//     "topology", [ "pointref", [ "indices", [ point of a vertex, ... ] ] ], ...,
//     "primitives", [ [ [ "type", TYPE, ... ], BODY ], ... ], ... ]
//
//   TYPE                     BODY
//   PolygonCurve_run or c_r  [ "startvertex", v, "nprimitives", n, "nvertices", [ vertices, ... ] ]
//   Polygon_run or p_r       the same, of closed polygons
//   Poly                     [ "vertex", [ vertex, ... ], "closed", bool ]
//   NURBCurve, BezierCurve   the same, and "basis", [ "order", n, "endinterpolation", bool,
//                            "knots", [ ... ] ]
//   run, of Houdini 12       [ [ [ vertex, ... ] ], ... ], and in front "runtype", "Poly",
//                            "varyingfields", [ "vertex" ], "uniformfields", { "closed": bool }
//
// Keys may be short: s_v n_p n_v. In place of "nvertices" there may be "nvertices_rle" or r_v:
// [ vertices, times, ... ]. Vertices of a run follow each other.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

// What the vertices of a curve are taken for.
struct HoudiniBasis {
  enum class Kind : std::uint8_t { kPolygon, kNurbs, kBezier };
  Kind kind = Kind::kPolygon;
  std::uint32_t order = 2;
  bool has_ends = true;  // a NURBS curve begins and ends at vertices
  // All, or those of NURBS curves from the first to the last of the range; none: 0, 1, 2, ...
  std::vector<float> knots;
  bool operator==(const HoudiniBasis&) const = default;
};

struct HoudiniCurves {
  std::vector<std::uint32_t> corners;           // of each curve, which is open
  std::vector<std::uint32_t> points;            // of all corners
  std::uint64_t closed_polygons = 0;            // which are no curves
  std::map<std::string, std::uint64_t> others;  // primitives of other types, runs as one
  std::vector<HoudiniBasis> bases;
  std::vector<std::uint32_t> basis_of;  // of each curve
  std::vector<float> weights;           // of the file's points; none: all are 1

  // The basis of the curve whose corners came last.
  void addBasis(HoudiniBasis basis) {
    if (bases.empty() || bases.back() != basis) bases.push_back(std::move(basis));
    basis_of.push_back(static_cast<std::uint32_t>(bases.size() - 1));
  }
  // Of point after point.
  void addWeight(std::uint32_t point, float weight) {
    if (weights.empty() && weight == 1) return;
    weights.resize(point, 1);
    weights.push_back(weight);
  }
};

// Reads them all, of version 5 too (cloud/houdini/geo_curves.h); memory is a small multiple of the
// size of the file. kCorruption, naming the byte or the curve, for what is no geometry, does not
// fit together, or refers to points that are not there.
Result<HoudiniCurves> readHoudiniCurves(const std::string& path);

}  // namespace surfeit
