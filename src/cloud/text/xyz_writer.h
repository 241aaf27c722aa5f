// Writes points as text: a line of numbers for each.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Comments, then the names of the columns ("# x y z nx ny nz"), then a line for each row: numbers
// are the shortest that read back as the same value, parted by single blanks. A name that ends with
// .csv (.gz and .zst aside) gets commas, and the names without the #.
Result<std::unique_ptr<RowWriter>> createXyz(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
