// Reads PCD files, the point clouds of PCL, ascii and binary.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/scans/pcd_format.h"

namespace surfeit {

// Rows have the fields of the file; normal_x _y _z become nx ny nz, packed rgb becomes red green
// blue of 8 bits, and rgba alpha besides; fields of several values get _0, _1, ...; 64-bit integers
// become doubles; padding is left out. A name that comes again becomes name_2. Binary files are
// seekable unless they are compressed as a whole; files that are compressed inside are kCorruption.
Result<std::unique_ptr<RowReader>> openPcd(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
