// Writes LAS, the format of laser scans (ASPRS), versions 1.2 to 1.5, not compressed.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Where `options.like` is a reader of LAS, the file gets its version, point format, scale, offset
// and records of variable length, and rows that come from it become the same bytes again. Otherwise
// it is version 1.4 with scale and offset by the bounds of the points, for which rows wait in a
// temporary file until finish(); a comment "crs ..." becomes the coordinate reference system. What
// no field of LAS holds is extra bytes, described as such. kInvalidArgument without positions.
Result<std::unique_ptr<RowWriter>> createLas(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
