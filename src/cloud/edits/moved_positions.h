// Tells by how much positions move where a format has only floats for them.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"

namespace surfeit {

// The writer itself unless its rows have positions as doubles; else one that looks at them and
// notes, once they are written, how far the farthest moves beside their spacing.
std::unique_ptr<RowWriter> watchPositions(std::unique_ptr<RowWriter> writer);

}  // namespace surfeit
