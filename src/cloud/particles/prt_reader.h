// PRT 1.0 and 1.1, the particles of Krakatoa:
//
//   [ magic 8 | header length i32 | "Extensible Particle Format" 32 | version i32 | count i64
//   | metadata chunks, when version is 2 | 4 i32 | channels i32 | bytes per channel i32
//   | channels | records, as one zlib stream ]
//
// little-endian. Channels are typed, lie in a record in any order and may leave gaps. A metadata
// chunk is [ "Meta" | length i32 | ... ]; the last is "Stop". Half floats become float, 64-bit
// integers double.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesPrt(std::string_view first_bytes);

// Rows of a PRT 1 file, one thread at a time. A file that was not completed (count -1) is
// decompressed once to count. Records that are missing or too many are kCorruption when the last
// row is read.
Result<std::unique_ptr<RowReader>> openPrt(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
