// The tree of an OpenVDB grid, walked in the order of the file: leaves of 8^3 voxels and active
// tiles, which stand for 8^3, 128^3 or 4096^3 voxels of one value.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_cursor.h"
#include "cloud/vdb/vdb_file.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::int32_t kVdbLeafSize = 8;  // voxels along an edge
inline constexpr std::size_t kVdbLeafVoxels = 512;
using VdbLeafMask = std::array<std::uint64_t, kVdbLeafVoxels / 64>;

// A leaf, or an active tile.
struct VdbBlock {
  VdbCoord origin = {};              // its least voxel
  std::int32_t size = kVdbLeafSize;  // voxels along an edge
  bool is_leaf = true;
  VdbLeafMask mask = {};         // active voxels of a leaf; bit x * 64 + y * 8 + z
  std::vector<std::byte> value;  // of a tile, decoded

  bool contains(const VdbCoord& voxel) const;
  // Active voxels.
  std::uint64_t voxelCount() const;
};

// Of the trees of 5_4_3 configuration, all that DCCs write: the type of their values. Nothing for
// types that no rows are made of.
std::optional<VdbValueType> vdbValueType(const VdbGrid& grid);

// Whether the tree has leaves with origin `a` before those with origin `b`.
bool precedesInTree(const VdbCoord& a, const VdbCoord& b);

// One thread at a time. Takes up to 1 MiB: the masks and active tiles of an inner node.
class VdbTreeWalk {
 public:
  // `grid` must outlive it. Children of the root out of the order in which OpenVDB writes them are
  // kCorruption, here or in next().
  static Result<VdbTreeWalk> open(const VdbFile& file, const VdbGrid& grid,
                                  const VdbValueType& type);

  // The next leaf or active tile, in the order of precedesInTree; false at the end.
  Result<bool> next(VdbBlock& block);

  const std::vector<std::byte>& background() const { return background_; }

 private:
  struct RootTile {
    VdbCoord origin;
    std::vector<std::byte> value;
  };
  // An inner node whose children are being walked.
  struct Node {
    VdbCoord origin = {};
    std::vector<std::uint64_t> children, active;
    std::vector<std::byte> values;  // of the active tiles, in order
    std::size_t next = 0;           // child or tile to look at
    std::size_t next_value = 0;
  };

  Status readRoot();
  Status enterRootChild();
  Status readNode(std::size_t depth, const VdbCoord& origin);
  bool nextRootTile(VdbBlock& block);
  // The next of a node's children or active tiles: its index, or nothing.
  std::optional<std::size_t> nextEntry(Node& node) const;

  VdbCursor cursor_;
  VdbValueType type_;
  std::uint32_t compression_ = 0;
  std::vector<std::byte> background_;
  std::vector<RootTile> root_tiles_;
  std::size_t next_root_tile_ = 0;
  std::uint32_t children_left_ = 0;
  std::optional<VdbCoord> child_origin_;  // of the root's next child
  std::optional<VdbCoord> last_child_;
  Node nodes_[2];  // of 32^3 and of 16^3 children
  std::size_t depth_ = 0;
};

}  // namespace surfeit
