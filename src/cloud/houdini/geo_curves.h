// The curves of Houdini's geometry of version 5, binary (.bgeo) and as text (.geo), behind its
// points (cloud/houdini/bgeo_reader.h). Both have the same parts in the same order:
//
//   counts, attributes of points, points (x y z w and attributes), attributes of vertices,
//   attributes of primitives, primitives, ...
//
//   primitive   binary                             text
//   run         FFFFFFFF, u16 times, TYPE          Run TIMES TYPE
//   TYPE        u32: 1 polygon, 2 NURBS curve,     Poly, NURBCurve, BezierCurve, Part
//               4 Bezier curve, 8000h particles
//   face        i32 vertices, '<' closed, ':' open 4 <
//   NURBS       u32 order, i16 ends, i16, knots    Basis 4 end 0 .5 1
//   Bezier      u32 order, u8 has knots, knots     Basis 4 use 0 1
//   vertex      point (u16 up to 65535 points,     3 (attributes)
//               else u32), attributes
//   behind      attributes of the primitive        [attributes]
//
// Knots are f32: of NURBS curves those from the first to the last of the range, once each, or,
// where ends are not interpolated, all but the outermost two.
#pragma once

#include <string>

#include "cloud/houdini/bgeo_curves.h"
#include "surfeit/status.h"

namespace surfeit {

// As readHoudiniCurves does. kCorruption also for primitives of other types than those: where they
// end is not known.
Result<HoudiniCurves> readGeoCurves(const std::string& path);
Result<HoudiniCurves> readGeoTextCurves(const std::string& path);

}  // namespace surfeit
