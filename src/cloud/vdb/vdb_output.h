// Writing an OpenVDB file: its parts in front of the trees' data, and trees given by their leaves.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/vdb/vdb_file.h"
#include "storage/file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A row, by the voxel that it lies in.
struct VdbEntry {
  std::uint64_t key = 0;  // of VdbTreeOrder
  std::uint64_t row = 0;
  bool operator<(const VdbEntry& other) const {
    return key != other.key ? key < other.key : row < other.row;
  }
};

// Numbers voxels in the order of the tree: a key is [rank of the root's child : 28 | its child : 15
// | that one's : 12 | voxel of the leaf : 9].
class VdbTreeOrder {
 public:
  // Makes known a voxel that will be asked for.
  void add(const VdbCoord& voxel);
  // After the last add().
  void rank();
  std::uint64_t key(const VdbCoord& voxel);
  // The least voxel of the leaf of a key.
  VdbCoord leafOrigin(std::uint64_t key) const;
  const VdbCoord& root(std::uint64_t key) const { return roots_[key >> 36]; }

 private:
  std::vector<VdbCoord> roots_;
  VdbCoord last_root_ = {1, 1, 1};  // no root begins there
  std::uint64_t last_rank_ = 0;
};

// A leaf: entries [begin, end) of a sorted list, with at least one of them.
struct VdbLeafRun {
  std::uint64_t begin = 0, end = 0;
};
std::vector<VdbLeafRun> findVdbLeaves(std::span<const VdbEntry> entries);

// Metadata of a text or number.
VdbMetadata vdbText(std::string name, std::string_view text);
VdbMetadata vdbInt64(std::string name, std::int64_t value);
VdbMetadata vdbBool(std::string name, bool value);
VdbMetadata vdbCoord(std::string name, const VdbCoord& value);

// A file that appears when it is finished. One thread at a time. The first failure is the answer of
// every later call. `progress`, if any, is polled by append(): kInterrupted.
class VdbOutput {
 public:
  static Result<VdbOutput> create(const std::string& path, std::span<const std::string> comments,
                                  std::uint32_t grid_count, const Progress* progress = nullptr);
  VdbOutput(VdbOutput&&) noexcept;
  VdbOutput& operator=(VdbOutput&&) noexcept;
  ~VdbOutput();

  std::uint64_t size() const;
  Status append(Bytes bytes);
  Status appendText(std::string_view text);
  template <typename T>
  Status appendValue(const T& value) {
    return append(std::as_bytes(std::span(&value, 1)));
  }
  Status patch(std::uint64_t offset, Bytes bytes);

  // Begins a grid; what follows is its tree (appendTree), then endTree(), its buffers, endGrid().
  // Grids are written with blosc and only with active values.
  Status beginGrid(const std::string& name, const std::string& type,
                   std::span<const VdbMetadata> metadata, Bytes transform_record);
  // The tree of these leaves, with a background of `value_bytes` zeros.
  Status appendTree(const VdbTreeOrder& order, std::span<const VdbEntry> entries,
                    std::span<const VdbLeafRun> leaves, std::size_t value_bytes);
  Status endTree();
  Status endGrid();
  // The active voxels of a leaf, 64 bytes.
  Status appendMask(std::span<const VdbEntry> leaf);
  // Values packed with blosc, behind their size.
  Status appendPacked(Bytes bytes, std::size_t value_bytes);

  // Gives the file an identity, which follows from its bytes, and its name.
  Status finish();

 private:
  struct State;
  explicit VdbOutput(std::unique_ptr<State> state);
  Status appendNode(std::span<const VdbEntry> entries, std::span<const VdbLeafRun> leaves,
                    int depth);
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
