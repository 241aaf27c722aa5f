// Results as OpenEXR: rows with pixel_x and pixel_y become a picture with the windows of the one
// that the receivers came from.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"

namespace surfeit {

// `options.like` must be a reader of OpenEXR (cloud/exr/exr_reader.h), and the rows must have
// pixel_x and pixel_y; otherwise kInvalidArgument says what to do. Display and data window, pixel
// aspect and attributes (worldToCamera, ...) are those of `like`.
//
// Channels: position as P.X P.Y P.Z, normal as N.X .Y .Z, color as R G B, alpha as A, depth as Z,
// other colors as NAME.R .G .B, vectors as NAME.X .Y .Z, single values as NAME. They are float,
// uint where the rows have unsigned integers, and half where `like` has a half channel of that
// name. A is always written, 1 where rows have no alpha. Without a color of their own, rows have R
// G B all the same, so that programs show something: a copy, in half floats, of the first of
// irradiance, environment, reflection, fluence, radiosity that is there, which the attribute
// mainLayer names. Pixels without a row are 0, infinite in Z.
//
// Rows must come in scan line order, as the reader has them (kInvalidArgument otherwise); so memory
// is a few scan lines.
Result<std::unique_ptr<RowWriter>> createExr(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
