// OpenVDB files (.vdb) as rows: the points of a point grid, or the active voxels of a volume.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "surfeit/status.h"

namespace surfeit {

bool recognisesVdb(std::string_view first_bytes);

// Opens the grid called options.part; without a name the first point grid, else the first volume of
// float, double, vec3s, vec3d or int32 values. Points: cloud/vdb/vdb_points_reader.h; volumes:
// vdb_volume_reader.h. Trees of another configuration than 5_4_3, transforms that are no affine
// ones, and files older than OpenVDB 2.0 are refused as kCorruption; kInvalidArgument when there is
// no grid of that name. A compressed file (.vdb.gz) must be decompressed first: grids are read from
// several places at once.
Result<std::unique_ptr<RowReader>> openVdb(const std::string& path,
                                           const RowReaderOptions& options);

}  // namespace surfeit
