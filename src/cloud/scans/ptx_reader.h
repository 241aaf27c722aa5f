// Reads Leica's PTX: scans as text, one after another, each a grid of points before a matrix that
// puts them into the world.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"

namespace surfeit {

// Two lines of one count each, four lines of three numbers, four lines of four.
bool recognisesPtx(std::string_view first_bytes);

// A scan is: columns and rows of its grid; the scanner's position and axes, three numbers each; a
// matrix of 4 x 4 that acts on row vectors, with the translation in its last row; then a point per
// line, x y z intensity or x y z intensity red green blue, as in all other scans. Points at 0 0 0
// are empty pixels of the grid: they are left out, and told. Rows are in the world: positions are
// doubles. They are counted here, with a pass over the file.
Result<std::unique_ptr<RowReader>> openPtx(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
