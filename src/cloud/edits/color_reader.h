// Colors as rows have them, whatever numbers a file has for them. Integers of 8 and 16 bits in
// wider types, bytes that are signed, 0-255 in reals and colors packed into one number become uchar
// or ushort, which code sRGB, or floats, which are scene-linear (docs/files.md, "Colors"): so that
// all that reads rows knows a color by its type. Opacities and normals in integers likewise.
#pragma once

#include <memory>

#include "cloud/rows/row_reader.h"
#include "surfeit/color_range.h"
#include "surfeit/status.h"

namespace surfeit {

// The same rows with such colors. What numbers mean is decided by a sample of the whole cloud:
// from up to 1024 places where the reader is seekable, else by one pass, both of which end when
// nothing is left to decide. A reader whose colors are plain is given back as it is. kCorruption
// when a color has numbers of no range that we know; reading rows, when one does not fit what the
// sample said.
Result<std::unique_ptr<RowReader>> readColors(std::unique_ptr<RowReader> reader, ColorRange range);

}  // namespace surfeit
