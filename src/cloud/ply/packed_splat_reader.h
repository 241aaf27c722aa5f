// Gaussian splats as SuperSplat compresses them in a PLY file: four words for each splat, and
// ranges for every 256 of them in an element `chunk`.
#pragma once

#include <memory>

#include "cloud/ply/ply_format.h"
#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// Whether the file has chunks, and vertices of packed_position, packed_rotation, packed_scale and
// packed_color.
bool arePackedSplats(const PlyHeader& header);

// Its splats, with the properties that areSplats (cloud/ply/splat_reader.h) asks for. The file
// is read at two places, the chunks beside the splats.
Result<std::unique_ptr<RowReader>> openPackedSplats(const std::string& path, Access access);

}  // namespace surfeit
