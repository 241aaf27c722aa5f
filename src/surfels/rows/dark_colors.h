// Colors that are black, or all but black, whoever wrote them.
#pragma once

#include <string>

#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// What is to be told of the red green blue of a cloud, with the way out: that all are 0, or whole
// numbers of 8 bits up to 1. Empty for other clouds, and where radiosity or albedo has light.
// Looks at all rows up to the first with light, or at a sample of a long cloud, then goes back to
// the first row. What cannot be read counts as the end: whoever reads the rows is told.
Result<std::string> noteOfDarkColors(RowReader& reader);

}  // namespace surfeit
