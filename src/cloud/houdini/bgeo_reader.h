// The points of Houdini's classic geometry, version 5 (before Houdini 12), big-endian:
//
//   [ "Bgeo" | 'V' | version i32 | 8 counts i32 | attributes | points | ... ]
//   attribute = [ name u16 + text | values u16 | type i32 | 4 bytes per value, its default ]
//   point = [ x y z w, f32 each | attributes in order, 4 bytes per value ]
//
// types: 0 float, 1 integer, 5 vector; 4 is an indexed string, whose default is a list of strings:
// its index is read as an integer. What follows the points (primitives, groups) is not looked at. w
// is a weight of curves, not a divisor, and not kept.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesBgeo(std::string_view first_bytes);

// Rows, one per point, one thread at a time. Seekable unless the file is compressed.
Result<std::unique_ptr<RowReader>> openBgeo(const std::string& path,
                                            const RowReaderOptions& options);

}  // namespace surfeit
