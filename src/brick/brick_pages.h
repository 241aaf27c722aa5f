// The leaves of a brick map in its file: where they are, and a cache of those in use.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "brick/brick_layout.h"
#include "cloud/vdb/vdb_file.h"
#include "cloud/vdb/vdb_tree.h"
#include "surfeit/brick.h"
#include "surfeit/status.h"

namespace surfeit {

// 8^3 voxels of a level and direction, decoded. Immutable.
struct BrickLeaf {
  VdbLeafMask mask = {};
  std::array<std::uint16_t, kVdbLeafVoxels / 64> rank = {};  // voxels in the words before
  std::vector<float> data;                                   // of each voxel: weight, values

  bool has(std::size_t voxel) const { return (mask[voxel / 64] >> (voxel % 64) & 1) != 0; }
  // The weight and values of a voxel that it has.
  const float* at(std::size_t voxel, std::size_t floats) const;
  std::size_t charge() const;
};

// Safe from any thread.
class BrickPages {
 public:
  // Errors as BrickMap::open.
  static Result<std::unique_ptr<BrickPages>> open(const std::string& path,
                                                  std::uint64_t memory_bytes);

  const std::vector<BrickChannel>& channels() const { return channels_; }
  std::size_t valueCount() const { return value_count_; }
  int levelCount() const { return level_count_; }
  double voxelSize(int level) const;

  // The leaf of a group that begins at `origin`; nullptr where there is none.
  Result<std::shared_ptr<const BrickLeaf>> leaf(int group, const VdbCoord& origin);

  std::uint64_t cachedBytes() const;
  std::uint64_t directoryBytes() const { return directory_bytes_; }

 private:
  // The grids of a level and direction, and their leaves in the order of the tree.
  struct Group {
    std::vector<const VdbGrid*> grids;  // the weights, then the channels
    std::vector<VdbCoord> origins;
    std::vector<std::uint64_t> offsets;  // of the buffers: those of a leaf side by side
  };
  struct Shard {
    using Entry = std::pair<std::uint64_t, std::shared_ptr<const BrickLeaf>>;
    std::mutex mutex;
    std::list<Entry> entries;  // the last used first
    std::unordered_map<std::uint64_t, std::list<Entry>::iterator> index;
    std::uint64_t bytes = 0;
  };
  static constexpr std::size_t kShards = 16;

  Status arrangeGrids();
  Status checkGroups() const;
  Status addChannel(const VdbGrid& grid, const std::string& name);
  Status findLeaves(Group& group);
  Status findBuffers(Group& group, std::size_t grid);
  Status corrupt(const VdbGrid& grid, const std::string& what) const;
  Result<std::shared_ptr<const BrickLeaf>> load(const Group& group, std::size_t leaf) const;
  Status checkMemory() const;

  std::shared_ptr<const VdbFile> file_;
  std::vector<BrickChannel> channels_;
  std::size_t value_count_ = 0;
  int level_count_ = 0;
  double voxel_size_ = 1;  // of level 0
  std::array<Group, kMostBrickGroups> groups_;
  std::uint64_t memory_bytes_ = 0, directory_bytes_ = 0, shard_bytes_ = 0;
  mutable std::array<Shard, kShards> shards_;
};

}  // namespace surfeit
