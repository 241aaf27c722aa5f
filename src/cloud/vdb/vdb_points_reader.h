// OpenVDB point grids as rows.
#pragma once

#include <memory>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/vdb/vdb_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Rows are the points of the grid, leaf by leaf, in the world's space; properties those of its
// attributes by cloud/rows/channels.h. x y z are float64 where the grid lies so far from the origin
// that float32 would be coarser than 1/4096 of a voxel. Attributes that rows cannot carry are told
// by notes(). Opening passes over the tree, and over what the file says of arrays; memory does not
// grow with the grid. `grid` is one of the file's, and isPoints().
Result<std::unique_ptr<RowReader>> openVdbPoints(std::shared_ptr<const VdbFile> file,
                                                 const VdbGrid& grid,
                                                 const RowReaderOptions& options);

// float32, or float64 where that is needed by the rule above: for voxels from `least` to
// `greatest`.
ValueType vdbPositionType(const VdbTransform& transform, const VdbCoord& least,
                          const VdbCoord& greatest);

// Comments that a writer has put in the file.
std::vector<std::string> vdbComments(const VdbFile& file);

}  // namespace surfeit
