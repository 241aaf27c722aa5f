// Holds a reader of rows to its contract (cloud/rows/row_reader.h) on whatever file it is given.
#pragma once

#include <memory>
#include <string>

#include "cloud/cloud_formats.h"

namespace surfeit {

using OpenRows = Result<std::unique_ptr<RowReader>> (*)(const std::string& path,
                                                        const RowReaderOptions& options);

// Bytes are refused for what they are, or for what of them is not read; never for the memory that
// they asked for. Aborts otherwise.
void checkRefusal(const Status& status);

// Opens the file and reads its rows in small and in large batches, from the start, after rewind()
// and after seekRow(), and as surfels. Aborts when rows are not as the element says, when there are
// more or fewer of them, or when they differ from one reading to the next.
void probeRows(const std::string& path, OpenRows open);

}  // namespace surfeit
