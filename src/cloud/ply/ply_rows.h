// PLY as rows of a cloud. cloud/ply/ply_format.h has the format; docs/format.md the names of
// properties.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/rows/row_writer.h"

namespace surfeit {

bool recognisesPly(std::string_view first_bytes);

// Reads the element of the surfels (findSurfelElement); lists and other elements are notes.
// `channels` rename properties, alone or all of a channel. Rows of binary files without lists are
// not copied, and are seekable unless the file is compressed.
Result<std::unique_ptr<RowReader>> openPlyRows(const std::string& path,
                                               const RowReaderOptions& options);

// Writes little-endian binary files (cloud/ply/ply_writer.h); keeps all types and all names of one
// word.
Result<std::unique_ptr<RowWriter>> createPlyRows(const std::string& path,
                                                 const RowWriterOptions& options);

}  // namespace surfeit
