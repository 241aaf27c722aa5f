// The points of Houdini's geometry since version 12, as binary JSON
// (cloud/houdini/bgeo_json_cursor.h):
//
//   [ ..., "pointcount", n, ..., "attributes", [ "pointattributes", [ attribute, ... ], ... ], ...
//   ] attribute = [ [ ..., "name", name, "type", "numeric" or "string", ... ],
//                 [ "size", components, "values", values, ... ] ]
//   values = [ "size", components, "storage", type, layout ]
//   layout = "tuples", [ [ x, y, z ], ... ]  or  "arrays", [ [ x, ... ], [ y, ... ], ... ]  or
//            "pagesize", rows, "packing", [ components, ... ],
//            "constantpageflags", [ [ bool per page ], ... ], "rawpagedata", [ ... ]
//
// Attributes are columns, in pages as a rule: they are read where they stand. Values that do not
// stand in one array go to a temporary file (TMPDIR), and so do all of a compressed file. Strings
// are read as their indices. Not read: text JSON (.geo), other kinds of attributes, .sc.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesBgeoJson(std::string_view first_bytes);

// Rows, one per point, one thread at a time. Seekable.
Result<std::unique_ptr<RowReader>> openBgeoJson(const std::string& path,
                                                const RowReaderOptions& options);

}  // namespace surfeit
