// Writes Houdini's classic geometry, version 5 (cloud/houdini/bgeo_reader.h has the layout), which
// Houdini, Partio and most tools read.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Reals become float32, integers int32, colors coded as integers linear float32. kInvalidArgument
// when rows have no position, or are more than the 2^31 - 1 that the format can count.
Result<std::unique_ptr<RowWriter>> createBgeo(const std::string& path,
                                              const RowWriterOptions& options);

}  // namespace surfeit
