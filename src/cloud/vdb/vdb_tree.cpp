#include "cloud/vdb/vdb_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

namespace surfeit {
namespace {

// Logarithms of children along an edge of an inner node, and of voxels along an edge of a child
constexpr int kLog2Children[2] = {5, 4};
constexpr int kLog2ChildVoxels[2] = {7, 3};
constexpr int kLog2RootChildVoxels = 12;

VdbCoord childOrigin(std::size_t depth, const VdbCoord& origin, std::size_t index) {
  const int log2 = kLog2Children[depth], voxels = kLog2ChildVoxels[depth];
  const std::size_t mask = (std::size_t{1} << log2) - 1;
  const std::size_t child[3] = {index >> (2 * log2), (index >> log2) & mask, index & mask};
  VdbCoord result = origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result[axis] += static_cast<std::int32_t>(child[axis] << voxels);
  }
  return result;
}

bool testBit(const std::vector<std::uint64_t>& words, std::size_t bit) {
  return ((words[bit / 64] >> (bit % 64)) & 1) != 0;
}

// Whether a root child can begin there: at a multiple of its size, and end within 32 bits.
bool isRootOrigin(const VdbCoord& origin) {
  return std::all_of(origin.begin(), origin.end(), [](std::int32_t value) {
    return (value & ((1 << kLog2RootChildVoxels) - 1)) == 0;
  });
}

}  // namespace

bool VdbBlock::contains(const VdbCoord& voxel) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if ((voxel[axis] & ~(size - 1)) != origin[axis]) return false;
  }
  return true;
}

std::uint64_t VdbBlock::voxelCount() const {
  if (!is_leaf) {
    const std::uint64_t edge = static_cast<std::uint64_t>(size);
    return edge * edge * edge;
  }
  std::uint64_t count = 0;
  for (const std::uint64_t word : mask) count += static_cast<std::uint64_t>(std::popcount(word));
  return count;
}

std::optional<VdbValueType> vdbValueType(const VdbGrid& grid) {
  struct Known {
    std::string_view tree;
    ValueType type;
    std::size_t components;
    bool is_real;
  };
  constexpr Known kKnown[] = {{"Tree_float_5_4_3", ValueType::kFloat32, 1, true},
                              {"Tree_double_5_4_3", ValueType::kFloat64, 1, true},
                              {"Tree_vec3s_5_4_3", ValueType::kFloat32, 3, true},
                              {"Tree_vec3d_5_4_3", ValueType::kFloat64, 3, true},
                              {"Tree_int32_5_4_3", ValueType::kInt32, 1, false},
                              {"Tree_ptdataidx32_5_4_3", ValueType::kInt32, 1, false}};
  for (const Known& known : kKnown) {
    if (grid.type != known.tree) continue;
    VdbValueType type;
    type.type = known.type;
    type.components = known.components;
    type.bytes = known.components * valueTypeBytes(known.type);
    type.is_half = grid.is_half && known.is_real;
    type.stored_bytes = type.is_half ? 2 * known.components : type.bytes;
    return type;
  }
  return {};
}

bool precedesInTree(const VdbCoord& a, const VdbCoord& b) {
  // Children of the root by coordinates, then the children of each node, at the first level at
  // which they differ
  constexpr int kShifts[] = {kLog2RootChildVoxels, kLog2ChildVoxels[0], kLog2ChildVoxels[1]};
  for (const int shift : kShifts) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int32_t at_a = a[axis] >> shift, at_b = b[axis] >> shift;
      if (at_a != at_b) return at_a < at_b;
    }
  }
  return false;
}

Result<VdbTreeWalk> VdbTreeWalk::open(const VdbFile& file, const VdbGrid& grid,
                                      const VdbValueType& type) {
  VdbTreeWalk walk;
  walk.cursor_ = VdbCursor(file.input, grid.tree_begin, grid.buffers_begin);
  walk.type_ = type;
  walk.compression_ = grid.compression;
  SURFEIT_RETURN_IF_ERROR(walk.readRoot());
  return walk;
}

Status VdbTreeWalk::readRoot() {
  std::uint32_t buffer_count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(buffer_count));
  if (buffer_count != 1) {
    return cursor_.corrupt(fmt::format("{} buffers per leaf, expected 1", buffer_count));
  }
  SURFEIT_ASSIGN_OR_RETURN(const Bytes background, cursor_.take(type_.bytes));
  background_.assign(background.begin(), background.end());
  std::uint32_t tile_count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(tile_count));
  SURFEIT_RETURN_IF_ERROR(cursor_.read(children_left_));
  const std::uint64_t tile_bytes = sizeof(VdbCoord) + type_.bytes + 1;
  if (tile_count * tile_bytes > cursor_.left()) {
    return cursor_.corrupt(fmt::format("{} tiles of {} bytes, {} bytes are left", tile_count,
                                       tile_bytes, cursor_.left()));
  }
  for (std::uint32_t i = 0; i < tile_count; ++i) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, cursor_.take(tile_bytes));
    if (bytes.back() == std::byte{0}) continue;
    RootTile tile;
    std::memcpy(tile.origin.data(), bytes.data(), sizeof(VdbCoord));
    if (!isRootOrigin(tile.origin)) return cursor_.corrupt("a tile at no multiple of 4096 voxels");
    const Bytes value = bytes.subspan(sizeof(VdbCoord), type_.bytes);
    tile.value.assign(value.begin(), value.end());
    root_tiles_.push_back(std::move(tile));
  }
  std::sort(root_tiles_.begin(), root_tiles_.end(),
            [](const RootTile& a, const RootTile& b) { return a.origin < b.origin; });
  return {};
}

// Reads the origin of the root's next child, and that child when its turn has come.
Status VdbTreeWalk::enterRootChild() {
  VdbCoord origin = {};
  SURFEIT_RETURN_IF_ERROR(cursor_.read(origin));
  if (!isRootOrigin(origin)) return cursor_.corrupt("a root child at no multiple of 4096 voxels");
  if (last_child_.has_value() && !(*last_child_ < origin)) {
    return cursor_.corrupt("root children out of order");
  }
  child_origin_ = last_child_ = origin;
  --children_left_;
  return {};
}

Status VdbTreeWalk::readNode(std::size_t depth, const VdbCoord& origin) {
  Node& node = nodes_[depth];
  const std::size_t words = (std::size_t{1} << (3 * kLog2Children[depth])) / 64;
  node.origin = origin;
  node.next = node.next_value = 0;
  for (std::vector<std::uint64_t>* mask : {&node.children, &node.active}) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, cursor_.take(words * 8));
    mask->resize(words);
    std::memcpy(mask->data(), bytes.data(), bytes.size());
  }
  for (std::size_t i = 0; i < words; ++i) {
    if ((node.children[i] & node.active[i]) != 0) {
      return cursor_.corrupt("an inner node has a child where it has an active tile");
    }
  }
  return readVdbActiveValues(cursor_, compression_, type_, node.active, node.values);
}

std::optional<std::size_t> VdbTreeWalk::nextEntry(Node& node) const {
  const std::size_t words = node.children.size();
  for (std::size_t word = node.next / 64; word < words; ++word) {
    std::uint64_t bits = node.children[word] | node.active[word];
    if (word == node.next / 64) bits &= ~std::uint64_t{0} << (node.next % 64);
    if (bits == 0) continue;
    const std::size_t index = word * 64 + static_cast<std::size_t>(std::countr_zero(bits));
    node.next = index + 1;
    return index;
  }
  node.next = words * 64;
  return {};
}

bool VdbTreeWalk::nextRootTile(VdbBlock& block) {
  if (next_root_tile_ == root_tiles_.size()) return false;
  const RootTile& tile = root_tiles_[next_root_tile_];
  if (child_origin_.has_value() && *child_origin_ < tile.origin) return false;
  block.origin = tile.origin;
  block.size = 1 << kLog2RootChildVoxels;
  block.is_leaf = false;
  block.value = tile.value;
  ++next_root_tile_;
  return true;
}

Result<bool> VdbTreeWalk::next(VdbBlock& block) {
  while (true) {
    if (depth_ == 0) {
      // At the root: tiles and children in the order of their origins
      if (!child_origin_.has_value() && children_left_ > 0) {
        SURFEIT_RETURN_IF_ERROR(enterRootChild());
      }
      if (nextRootTile(block)) return true;
      if (!child_origin_.has_value()) return false;
      SURFEIT_RETURN_IF_ERROR(readNode(0, *child_origin_));
      child_origin_.reset();
      depth_ = 1;
      continue;
    }

    Node& node = nodes_[depth_ - 1];
    const std::optional<std::size_t> entry = nextEntry(node);
    if (!entry.has_value()) {
      --depth_;
      continue;
    }
    const VdbCoord origin = childOrigin(depth_ - 1, node.origin, *entry);
    if (!testBit(node.children, *entry)) {
      block.origin = origin;
      block.size = 1 << kLog2ChildVoxels[depth_ - 1];
      block.is_leaf = false;
      const std::byte* value = node.values.data() + node.next_value++ * type_.bytes;
      block.value.assign(value, value + type_.bytes);
      return true;
    }
    if (depth_ == 1) {
      SURFEIT_RETURN_IF_ERROR(readNode(1, origin));
      depth_ = 2;
      continue;
    }
    SURFEIT_RETURN_IF_ERROR(cursor_.read(block.mask));
    block.origin = origin;
    block.size = kVdbLeafSize;
    block.is_leaf = true;
    return true;
  }
}

}  // namespace surfeit
