// The alpha of colors, which surfels do not have: what covers in part has an opacity.
#pragma once

#include <string>

#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// What is to be told of the alpha of a cloud, with the way out; empty when there is none, or all is
// opaque. Looks at a sample of the whole cloud, or, where a reader has no random access, at all
// rows until a batch has some that are not opaque; then goes back to the first row. `has_opacity`:
// surfels take one beside the alpha. What cannot be read counts as the end: whoever reads the rows
// is told.
Result<std::string> noteOfUnusedAlpha(RowReader& reader, bool has_opacity);

}  // namespace surfeit
