// 3D Gaussian splats, stored as the vertices of a PLY file, as disks. A splat is a Gaussian with
// three axes: its scales are stored as logarithms, its rotation as a quaternion (w, x, y, z), its
// opacity as a logit, its color as the coefficients of spherical harmonics.
//
// - normal: the rotated axis of the smallest scale; of splats of two scales, their third axis. Its
//   sign means nothing, so disks are two-sided.
// - radius: sqrt(2 s1 s2) with the two largest scales. The Gaussian exp(-r^2 / 2) with the scales
//   s1 and s2 integrates to 2 pi s1 s2: the disk covers as much as the splat at full opacity.
// - red green blue: 0.5 + f_dc / (2 sqrt(pi)), not below 0. Splats are fitted to pictures that are
//   coded as sRGB, so this is decoded to scene-linear light. Without f_dc, red green blue in uchar.
// - opacity: 1 / (1 + exp(-opacity)). Splats below 1/255, which viewers leave out, keep their rows.
// - coverage: the opacity, at least 1e-6, for a surfel has an area. Splats overlap as their
// training
//   left them, so the indexer finds by the neighbourhood how much of a disk's area is its own.
// - position and properties that splats do not use: as they are.
//
// What depends on the direction (f_rest) is not kept. The quaternion need not have length 1; where
// it is zero the normal is NaN.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "surfeit/status.h"

namespace surfeit {

// f_dc times this is what a splat's color differs from one half: 1 / (2 sqrt(pi)), the constant
// harmonic.
inline constexpr double kSplatColorFactor = 0.28209479177387814;

// Whether the vertices of a PLY file are splats: f_dc_0 to f_dc_2 (or red green blue in uchar),
// opacity, scale_0 and scale_1, rot_0 to rot_3.
bool areSplats(const RowLayout& element);

// What is missing where most of the properties of splats are there; empty elsewhere.
std::vector<std::string> missingOfSplats(const RowLayout& element);

// The rows of `splats`, of which areSplats() holds, as disks. Looks at rows, and goes back to the
// first.
Result<std::unique_ptr<RowReader>> readSplatsAsDisks(std::unique_ptr<RowReader> splats);

}  // namespace surfeit
