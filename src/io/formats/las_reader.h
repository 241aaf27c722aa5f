// Reads LAS, the format of laser scans (ASPRS): versions 1.0 to 1.4, point formats 0 to 10, not
// compressed.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "io/cloud_formats.h"
#include "io/row_reader.h"

namespace surfeit {

// Also LAZ, its compressed form, so that openLas can say what to do.
bool recognisesLas(std::string_view first_bytes);

// Rows have x y z as doubles, scaled and moved as the header says, since coordinates of maps need
// more than a float; intensity (ushort), classification (uchar) and, where the point format has
// them, red green blue (ushort, as they stand). What else a point has is not kept. LAZ is
// kCorruption.
Result<std::unique_ptr<RowReader>> openLas(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
