// NURBS and Bezier curves as points along them.
#pragma once

#include <span>
#include <vector>

#include "cloud/houdini/bgeo_curves.h"
#include "sample/meshes/curves.h"
#include "surfeit/status.h"

namespace surfeit {

// Points of each span between knots, and of each Bezier segment.
inline constexpr int kSplineSteps = 8;

// Points along the curve of these control points, ends included; those of a polygon as they are.
// Places, widths and colors are weighted alike. `weights`: one each, above 0, or none, which are 1.
// kCorruption without a path: "3 vertices, ...", where vertices or knots do not fit the order.
Status evaluateSpline(const HoudiniBasis& basis, std::span<const CurvePoint> control,
                      std::span<const float> weights, std::vector<CurvePoint>& points);

}  // namespace surfeit
