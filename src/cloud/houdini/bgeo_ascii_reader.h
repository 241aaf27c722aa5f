// The points of Houdini's classic geometry as text (.geo, "PGEOMETRY V5"):
//
//   PGEOMETRY V5
//   NPoints 5 NPrims 1
//   NPointGroups 0 NPrimGroups 0
//   NPointAttrib 2 NVertexAttrib 0 NPrimAttrib 1 NAttrib 0
//   PointAttrib
//   life 2 float 0 0
//   id 1 int 0
//   0 0.1 0.2 1 (-1.2 10	0)
//   ...
//
// A point is x y z w, then the values of its attributes in parentheses. Types: float, int, vector,
// index (strings, read as their indices). Any blanks separate. What follows the points is not
// looked at.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesBgeoAscii(std::string_view first_bytes);

// Rows, one per point, one thread at a time.
Result<std::unique_ptr<RowReader>> openBgeoAscii(const std::string& path,
                                                 const RowReaderOptions& options);

}  // namespace surfeit
