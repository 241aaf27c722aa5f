// Numbers that say how contributions cover pixels; docs/algorithm.md, "Coverage", has their
// measured effect. ReceiverRaster and PacketRaster share them.
#pragma once

namespace surfeit {

// How far before and behind its middle a contribution meets others of its layer, in radii. Less
// tears surfaces apart (errors double at 0.5), more joins what is apart (a tenth more at 1.5).
inline constexpr float kLayerReach = 1;

// How much is added to a layer that nearly fills a pixel. Measured at max solid angle .1 and .05,
// AO RMSE: .0154 and .0095 with 0, .0100 and .0078 with .1 (spheres on a plane); .0098 and .0095,
// .0081 and .0080 (bunny on a plane).
inline constexpr float kFill = 0.1f;

// A receiver without a normal is itself a sphere of a cloud without normals. Spheres of its own
// surface, closer than this many of their radii, do not count: they overlap it at random depths,
// and how much each sticks out is noise of the sampling (speckle), not occlusion.
inline constexpr float kSphereClearance = 3;

// The square of the least extent of a disk on a face, over its radius: keeps a disk seen edge-on
// from becoming a line.
inline constexpr float kLeastExtentSq = 1.f / 64;

}  // namespace surfeit
