// Positions of ascii PLY files, whose digits may be more than the floats of the header hold.
#pragma once

#include "cloud/ply/ply_format.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// Makes x, y and z doubles in elements of an ascii file where the header says float and numbers of
// a sample of the whole file have digits that floats lose, as on a map. Of a compressed file or a
// stream, the sample is its beginning.
Status widenPositions(ByteInput& file, PlyHeader& header);

}  // namespace surfeit
