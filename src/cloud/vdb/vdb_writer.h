// Rows as OpenVDB files: points, or grids that continue a volume. Files are version 224, packed
// with blosc; OpenVDB 5 (2017) and later read them.
#pragma once

#include <memory>
#include <string>

#include "cloud/rows/row_writer.h"
#include "surfeit/status.h"

namespace surfeit {

// Where options.like is a volume of an OpenVDB file (cloud/vdb/vdb_volume_reader.h) and the rows
// have voxel_i voxel_j voxel_k: a grid per channel, named as it, with the transform, the class and
// the metadata of that volume and the values of the rows at their voxels; the background is 0.
// Single reals are float grids, three vec3s grids (float64 becomes float32), integers int32 grids.
// Of rows for one voxel the last counts. Positions, radii and the voxels themselves are no grids,
// nor is the "distance" of a level set, whose inside rows do not have.
//
// Otherwise: a point grid, "points", with x y z as P (vec3s from the voxel's centre, exact to
// 2^-25 of a voxel), and an attribute per channel by the names of Houdini and Blender: N, pscale,
// Cd, v, id; others keep theirs, with _ for what such names may not have. Colors of 8 and 16 bits
// become linear floats; uint8 int16, uint16 int32, uint32 int64; other types are kept. The edge of
// a voxel is the largest extent of the cloud over a power of 2, at most 2^20, the smallest that
// leaves 8 points or more per occupied voxel and 256 or more per leaf of 8^3 voxels on average, of
// clouds without an extent 1. A leaf may have any number of points, up to 512 MiB of an attribute.
// Points are written in the order of their voxels, then of the rows; those without finite positions
// are left out, which notes() tells when the file is finished.
//
// Either way rows are held until finish(), with 16 bytes each; kBudgetTooSmall when they need more
// than options.memory_bytes, at once where options.count tells. Besides, finish() takes two pages
// of 1 MiB, or of the largest leaf's array of an attribute.
Result<std::unique_ptr<RowWriter>> createVdb(const std::string& path,
                                             const RowWriterOptions& options);

}  // namespace surfeit
