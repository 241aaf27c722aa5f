// The voxels of a brick map, sorted, as an OpenVDB file: grids of a level and direction side by
// side, from passes over the sorted voxels that hold no more than a node of the tree.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "brick/brick_layout.h"
#include "cloud/vdb/vdb_output.h"
#include "storage/external_sorter.h"
#include "surfeit/brick.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// The voxels of a level and direction.
struct BrickGroup {
  std::uint64_t voxels = 0;
  VdbCoord least = {}, greatest = {};

  void add(const VdbCoord& voxel);
};

// Records of the sorter: a BrickKey, a weight, and values, as floats.
inline std::size_t brickRecordBytes(std::size_t value_count) {
  return kRecordKeyBytes + sizeof(float) * (1 + value_count);
}

// One thread at a time.
class BrickWriter {
 public:
  // Voxels of level 0 have edges of `voxel_size`. `groups` are by level and direction; all
  // references must outlive the writer.
  BrickWriter(ExternalSorter& voxels, std::span<const BrickGroup> groups,
              std::span<const BrickChannel> channels, double voxel_size);

  // Writes all and gives the file its name; `file_bytes` is its size.
  Status write(const std::string& path, double max_error, Progress& progress,
               std::uint64_t& file_bytes);

 private:
  // What of a record a grid holds.
  struct Grid {
    std::string name;
    std::string properties;
    std::size_t offset = 0;  // floats behind the key
    std::size_t components = 1;
  };

  Status writeGroup(VdbOutput& output, int group, Progress& progress);
  Status beginGrid(VdbOutput& output, int group, const Grid& grid);
  Status findNodes(int group, std::vector<BrickKey>& nodes);
  Status writeTree(VdbOutput& output, const Grid& grid, std::span<const BrickKey> nodes);
  Status writeNode(VdbOutput& output, const BrickKey& node);
  Status writeBuffers(VdbOutput& output, int group, const Grid& grid, Progress& progress);

  ExternalSorter& voxels_;
  std::span<const BrickGroup> groups_;
  double voxel_size_;
  std::vector<Grid> grids_;  // of a group
};

}  // namespace surfeit
