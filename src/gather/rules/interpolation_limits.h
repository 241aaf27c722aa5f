// The numbers that decide where results are interpolated, and how far they may be off. Rows are of
// bench/interpolation, color, a max variation of .02, 16 receivers for each surfel: share of the
// receivers gathered, share of them off by more than the variation.
#pragma once

#include <cstddef>

namespace surfeit {

struct InterpolationLimits {
  // --- Which packets are samples (docs/many_gathers.md, "Interpolation") ---

  // Packets, a power of 2 up to 128. Cells of so many have one sample at first; one that is not
  // smooth is halved, down to pairs. (16: a Cornell box 16 instead of 13 %.)
  std::size_t widest_cell = 32;

  // --- Which samples a packet resembles ---

  // Samples, up to 16. A fit draws from so many, and needs so many. (5 and 8: shares differ by less
  // than a tenth.)
  std::size_t most_samples = 6, least_samples = 2;
  // Cosine, 0 to 1. Mean normals farther apart are of different surfaces, or of one that bends too
  // much. (.9: spheres 37 instead of 32 %.)
  float least_cosine = 0.8f;
  // Sine, 0 to 1, of the angle between a surface and the line to another packet on it. Chords of a
  // sphere lie in it. (.15: the same.)
  float most_rise = 0.25f;

  // --- The fit ---

  // Part, 0 to 1, of the weight of all samples that is added in every direction of the fit. Across
  // a plane samples do not say how results change, and then they do not. (1e-4: a scan 57 instead
  // of 37 %; 1e-6: the same.)
  double ridge = 1e-5;
  // Variance of a fit at a receiver, over that of the mean of its samples, 1 or more. Beyond, a
  // receiver lies outside of its samples, off their surface, or faces elsewhere. (300: 1 % of the
  // receivers of a Cornell box are off instead of .2 %.)
  double most_leverage = 100;

  // --- The errors ---

  // Part, 0 to 1, of the max variation that samples around a packet are off at most when others
  // foretell them. (.5: 1.3 % of the receivers of the lion are off instead of .6 %; .4: spheres 39
  // instead of 36 %.)
  float tolerance = 0.45f;
  // Samples, 1 or more, around a packet that others can foretell at least; those at the end of a
  // surface they cannot.
  std::size_t least_foretold = 2;
};

inline constexpr InterpolationLimits kInterpolation;

}  // namespace surfeit
