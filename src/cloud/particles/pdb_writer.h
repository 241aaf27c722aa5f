// Writes PDB files (cloud/particles/pdb_reader.h has the layout), little-endian.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Reals become float32, integers int32, colors coded as integers linear float32. Rows wait in a
// temporary file (TMPDIR) until all are there, because attributes stand one behind the other.
// kInvalidArgument when rows have no position, or are more than 2^32 - 1.
Result<std::unique_ptr<RowWriter>> createPdb(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
