// How a brick map is laid out: levels, directions, and the order of voxels in the file
// (docs/brick.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string_view>

#include "cloud/vdb/vdb_file.h"

namespace surfeit {

// Values are kept apart by the way that surfaces face: along +x -x +y -y +z -z, and those without a
// normal.
inline constexpr int kBrickDirections = 7;
inline constexpr int kNoDirection = 6;
inline constexpr std::array<std::string_view, kBrickDirections> kBrickDirectionNames = {
    "px", "nx", "py", "ny", "pz", "nz", "any"};

// Voxels of level 0 along an axis: cells of a Morton key of 21 bits per axis, one bit to spare for
// the alignment of the coarsest level.
inline constexpr int kBrickMortonBits = 21;
inline constexpr std::int64_t kMostBrickVoxels = std::int64_t{1} << (kBrickMortonBits - 1);
// Of a coordinate of a voxel: 18 bits of roots are kept of it.
inline constexpr std::int64_t kLargestBrickCoordinate = (std::int64_t{1} << 29) - 1;
inline constexpr int kMostBrickLevels = kBrickMortonBits + 1;
// The coarsest level has no more voxels along an axis.
inline constexpr std::int64_t kCoarsestVoxels = 8;

// Groups of grids, one for every level and direction.
inline constexpr int kMostBrickGroups = kMostBrickLevels * kBrickDirections;

// How much a surface with that normal (unit, or zero: none) counts in each direction: the squares
// of the normal's coordinates, less what would make a direction of nearly none of it. The squares
// add up to 1, so that opposite normals share no direction, and what is seen at 7 degrees or less
// is left out.
inline std::array<float, kBrickDirections> directionWeights(const glm::vec3& normal) {
  constexpr float kLeastShare = 1.0f / 64;
  std::array<float, kBrickDirections> weights = {};
  if (normal.x == 0 && normal.y == 0 && normal.z == 0) {
    weights[kNoDirection] = 1;
    return weights;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const float share = (normal[axis] * normal[axis] - kLeastShare) / (1 - kLeastShare);
    weights[static_cast<std::size_t>(2 * axis + (normal[axis] < 0 ? 1 : 0))] =
        std::max(share, 0.0f);
  }
  return weights;
}

// The order of voxels in the file: groups, then children of the root by their signed coordinates,
// then the digits of a tree of 32^3, 16^3 and 8^3.
//   first  = [group : 8 | root x : 18 | root y : 18 | root z : 18]
//   second = [child : 15 | leaf : 12 | voxel : 9]
struct BrickKey {
  std::uint64_t first = 0, second = 0;
};
inline constexpr int kBrickLeafShift = 9, kBrickChildShift = 21;
inline constexpr int kBrickGroupShift = 54;

inline BrickKey brickKey(int group, const VdbCoord& voxel) {
  BrickKey key;
  key.first = static_cast<std::uint64_t>(group);
  for (const std::int32_t value : voxel) {
    key.first = key.first << 18 | static_cast<std::uint64_t>((value >> 12) + (1 << 17));
  }
  constexpr int kShifts[3] = {7, 3, 0}, kBits[3] = {5, 4, 3};
  for (int depth = 0; depth < 3; ++depth) {
    for (const std::int32_t value : voxel) {
      const std::uint32_t digit =
          static_cast<std::uint32_t>(value) >> kShifts[depth] & ((1u << kBits[depth]) - 1);
      key.second = key.second << kBits[depth] | digit;
    }
  }
  return key;
}

// The origin of the root's child that holds the voxel of a key.
inline VdbCoord brickRoot(const BrickKey& key) {
  VdbCoord root;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto biased = static_cast<std::int32_t>(key.first >> (18 * (2 - axis)) & ((1 << 18) - 1));
    root[axis] = (biased - (1 << 17)) * 4096;
  }
  return root;
}

// Names in the metadata of grids.
inline constexpr const char* kBrickVersionName = "brick_version";
inline constexpr const char* kBrickChannelName = "brick_channel";        // "area" of the weights
inline constexpr const char* kBrickPropertiesName = "brick_properties";  // "" of the weights
inline constexpr const char* kBrickLevelName = "brick_level";
inline constexpr const char* kBrickDirectionName = "brick_direction";
inline constexpr std::int64_t kBrickVersion = 1;
inline constexpr const char* kBrickWeightName = "area";

}  // namespace surfeit
