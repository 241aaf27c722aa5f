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
//   run, of Houdini 12       [ [ [ vertex, ... ] ], ... ], and in front "runtype", "Poly",
//                            "varyingfields", [ "vertex" ], "uniformfields", { "closed": bool }
//
// Keys may be short: s_v n_p n_v. In place of "nvertices" there may be "nvertices_rle" or r_v:
// [ vertices, times, ... ]. Vertices of a run follow each other.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

struct HoudiniCurves {
  std::vector<std::uint32_t> corners;           // of each curve: an open polygon
  std::vector<std::uint32_t> points;            // of all corners
  std::uint64_t closed_polygons = 0;            // which are no curves
  std::map<std::string, std::uint64_t> others;  // primitives of other types, runs as one
};

// Reads them all; memory is a small multiple of the size of the file. kCorruption, naming the byte
// or the curve, for what is no binary JSON, does not fit together, or refers to points that are not
// there; also for NURBS and Bezier curves, with what to do.
Result<HoudiniCurves> readHoudiniCurves(const std::string& path);

}  // namespace surfeit
