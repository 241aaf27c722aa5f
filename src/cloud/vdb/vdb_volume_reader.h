// Voxels of OpenVDB volumes as rows: places to be lit, or spheres that emit.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/vdb/vdb_tree.h"
#include "surfeit/status.h"

namespace surfeit {

// Names of the properties that tell which voxel a row is.
inline constexpr const char* kVoxelNames[3] = {"voxel_i", "voxel_j", "voxel_k"};

// A row for every active voxel of a grid, active tiles voxel by voxel, in the order of the tree:
// x y z, the voxel's centre in the world's space (float64 by the rule of vdb_points_reader.h);
// radius, of the sphere that has the voxel's volume; voxel_i voxel_j voxel_k; the grid's value, a
// channel called "distance" for a level set and as the grid otherwise; and the values of all other
// grids of the file with the same transform at that voxel, by their names (their background where
// they are not active). Rows have no normals: as receivers they are lit from all sides, as surfels
// they are spheres.
class VdbVolumeReader final : public RowReader {
 public:
  // `grid` is one of the file's, with values by vdbValueType().
  static Result<std::unique_ptr<RowReader>> open(std::shared_ptr<const VdbFile> file,
                                                 const VdbGrid& grid,
                                                 const RowReaderOptions& options);

  const std::string& path() const override { return file_->input.path(); }
  std::string formatName() const override;
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override;
  std::vector<std::string> notes() const override { return notes_; }
  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override;
  Status rewind() override;

  // The grid whose voxels the rows are; as long as the reader.
  const VdbGrid& grid() const { return grid_; }

 private:
  // The leaves and tiles of a grid with their values.
  struct Volume {
    const VdbGrid* grid = nullptr;
    VdbValueType type;
    std::size_t offset = 0;  // of the values in a row
    bool is_in_rows = true;
    std::optional<VdbTreeWalk> walk;
    VdbCursor buffers;
    VdbBlock block;
    bool has_block = false;
    std::vector<std::byte> values;  // active ones of the block, if it is a leaf
    std::vector<std::byte> scratch;
  };

  VdbVolumeReader(std::shared_ptr<const VdbFile> file, const VdbGrid& grid)
      : file_(std::move(file)), grid_(grid) {}
  Status countVoxels(std::uint64_t& count, ValueType& position_type) const;
  Status declare(const RowReaderOptions& options);
  Status declareVolume(const VdbGrid& grid, const std::string& name,
                       const RowReaderOptions& options);
  Status nextBlock(Volume& volume) const;
  Status nextRows();
  void placeVoxels();
  Status placeValues(Volume& volume);

  std::shared_ptr<const VdbFile> file_;
  const VdbGrid& grid_;
  RowLayout element_;
  std::vector<std::string> notes_;
  std::vector<Volume> volumes_;  // the first is the one of the rows
  std::size_t voxel_offset_ = 0, position_offset_ = 0, radius_offset_ = 0;
  bool has_position_ = false, has_radius_ = false, has_voxel_ = false;
  ValueType position_type_ = ValueType::kFloat32;

  // Rows of a leaf, or of as much of a tile
  VdbCoord origin_ = {};
  VdbLeafMask mask_ = {};
  std::uint64_t next_part_ = 0;  // of the current tile
  std::vector<std::byte> rows_;
  std::size_t rows_next_ = 0;
  std::uint64_t rows_left_ = 0;
  Status failure_;
};

}  // namespace surfeit
