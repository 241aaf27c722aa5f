// Render passes as receivers: an OpenEXR picture with the world position and the normal of what
// each pixel sees is a cloud with a row for every pixel that sees something.
//
// Channels. Positions are P.X P.Y P.Z, also with the endings .R .G .B or in small letters, or
// position.*, normals N.* or normal.*, all with any layer in front (ViewLayer.Position.X); others
// by --channels LAYER=position. Rows are x y z, nx ny nz where there are normals, pixel_x pixel_y
// (int32, coordinates of the data window), and the other channels by cloud/rows/channels.h: LAYER.R
// .G .B as a color, LAYER.X .Y .Z as a vector, R G B as `color`, A as `alpha`, Z or depth as
// `depth`, all as float32 whether the file has half or float; integers stay uint32.
//
// Mask. A pixel is a row when all of these hold, as far as the channels are there: alpha is above
// 0; depth is finite and below 1e30; the position is finite; position and normal are not both
// exactly 0 0 0 (nor is the position alone, where there is no normal). So empty pixels are found
// whichever way a renderer leaves them.
//
// Scan lines and tiles (the largest level) of any compression. Of several parts the first with
// positions is read, and with it those with the same data window and view, whose layers it lacks;
// with `part` that part alone. Deep parts are not read, and neither are subsampled channels.
#pragma once

#include <OpenEXR/ImfForward.h>

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"

namespace surfeit {

bool recognisesExr(std::string_view first_bytes);

// Rows in scan line order, from the top. Decodes the picture once to count them; takes a block of
// scan lines or a row of tiles of memory, 192 MiB at most. kCorruption when the file is damaged or
// has no positions; kInvalidArgument for a `part` that it does not have, and for blocks that are
// too large.
Result<std::unique_ptr<RowReader>> openExr(const std::string& path,
                                           const RowReaderOptions& options);

// The header of the part with the positions, when the rows come from openExr, else nullptr. Lasts
// as long as the reader.
const Imf::Header* exrHeaderOf(const RowReader* reader);

// Attribute of pictures that Surfeit writes: the layer that R, G and B are a copy of.
inline constexpr const char* kExrMainLayerAttribute = "mainLayer";

}  // namespace surfeit
