// What values a gather can calculate with.
#pragma once

namespace surfeit {

// Largest values of a surfel: their squares and the sums over a cloud must be floats
// (docs/format.md, "Limits").
inline constexpr float kLargestLength = 1e12f;  // coordinates and radii
inline constexpr float kLargestArea = 1e24f;
inline constexpr float kLargestColor = 1e12f;  // radiosity and albedo

}  // namespace surfeit
