// Reads points as text: a line of numbers for each (.xyz, .txt, .asc, .csv, .pts).
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"

namespace surfeit {

// A text whose first line of data begins with three numbers; whose first line, or a comment in
// front of the data, names x, y and z; or that begins with a line of one whole number, the count of
// PTS, and then three numbers.
bool recognisesXyz(std::string_view first_bytes);

// Values are parted by blanks, tabs, commas or semicolons; lines that begin with # or // are
// comments. Columns are named by a first line, or the last comment in front of the data, that names
// x, y and z ("# x y z nx ny nz"); else by their number and values (cloud/text/xyz_layout.h). Rows
// are counted here, with a pass over the file. All rows have as many values as the first.
Result<std::unique_ptr<RowReader>> openXyz(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
