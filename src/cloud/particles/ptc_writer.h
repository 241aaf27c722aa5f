// Writes Pixar's point clouds (cloud/particles/ptc_format.h).
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// All values become floats. Position, normal and radius go to the point itself: without normals
// points have the zero normal (spheres); without radii they are those of disks of the area, half
// the width, or 0. All other channels become variables by their kind, called so that openPtc reads
// them back under the same names: _area, _radiosity, ... Integers of red, green and blue become
// scene-linear. Normals that are not finite become zero normals. The camera is that of
// `options.like` when it is a point cloud of this format. kInvalidArgument without positions, or
// with more channels than a header may have.
//
// Version 0 is the one that everything reads; the bounds and the count are completed by finish().
Result<std::unique_ptr<RowWriter>> createPtcVersion(const std::string& path,
                                                    const RowWriterOptions& options, int version);
// The same in version 0.
Result<std::unique_ptr<RowWriter>> createPtc(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
