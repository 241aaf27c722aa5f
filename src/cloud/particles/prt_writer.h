// Writes PRT 1.0 (cloud/particles/prt_reader.h has the layout).
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Types are kept, except that colors coded as integers become linear float32. kInvalidArgument when
// rows have no position, or a channel's name is longer than the 31 characters that PRT has. The
// file is one zlib stream after its header: rows are not kept in memory.
Result<std::unique_ptr<RowWriter>> createPrt(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
