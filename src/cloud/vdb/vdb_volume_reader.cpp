#include "cloud/vdb/vdb_volume_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "cloud/parts/bytes_behind.h"
#include "cloud/vdb/vdb_attribute.h"
#include "cloud/vdb/vdb_points_reader.h"

namespace surfeit {
namespace {

// Walked side by side, each with up to a MiB of nodes and buffers
constexpr std::size_t kMaxVolumes = 64;

bool isLevelSet(const VdbGrid& grid) { return grid.text("class") == "level set"; }

// The origin of part `part` of a tile, in the order of the tree.
VdbCoord partOrigin(const VdbBlock& tile, std::uint64_t part) {
  // From the finest: 16^3 leaves in 128^3 voxels, 32^3 of those in 4096^3
  VdbCoord origin = tile.origin;
  constexpr int kLog2[] = {4, 5};
  int shift = 3;
  for (const int log2 : kLog2) {
    const std::uint64_t mask = (std::uint64_t{1} << log2) - 1;
    const std::uint64_t index = part & ((std::uint64_t{1} << (3 * log2)) - 1);
    origin[0] += static_cast<std::int32_t>((index >> (2 * log2)) << shift);
    origin[1] += static_cast<std::int32_t>(((index >> log2) & mask) << shift);
    origin[2] += static_cast<std::int32_t>((index & mask) << shift);
    part >>= 3 * log2;
    shift += log2;
  }
  return origin;
}

std::uint64_t partCount(const VdbBlock& block) {
  const std::uint64_t edge = static_cast<std::uint64_t>(block.size / kVdbLeafSize);
  return edge * edge * edge;
}

// Calls visit(voxel, number of active voxels before it) for every active voxel.
template <typename Visit>
void forActive(const VdbLeafMask& mask, Visit visit) {
  std::size_t number = 0;
  for (std::size_t word = 0; word < mask.size(); ++word) {
    for (std::uint64_t bits = mask[word]; bits != 0; bits &= bits - 1) {
      visit(word * 64 + static_cast<std::size_t>(std::countr_zero(bits)), number++);
    }
  }
}

}  // namespace

Result<std::unique_ptr<RowReader>> VdbVolumeReader::open(std::shared_ptr<const VdbFile> file,
                                                         const VdbGrid& grid,
                                                         const RowReaderOptions& options) {
  std::unique_ptr<VdbVolumeReader> reader(new VdbVolumeReader(std::move(file), grid));
  SURFEIT_RETURN_IF_ERROR(reader->declare(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

std::string VdbVolumeReader::formatName() const {
  if (isLevelSet(grid_)) return "OpenVDB level set";
  return grid_.text("class") == "fog volume" ? "OpenVDB fog volume" : "OpenVDB volume";
}

std::vector<std::string> VdbVolumeReader::comments() const { return vdbComments(*file_); }

Status VdbVolumeReader::countVoxels(std::uint64_t& count, ValueType& position_type) const {
  constexpr std::uint64_t kMostVoxels = std::uint64_t{1} << 60;
  SURFEIT_ASSIGN_OR_RETURN(VdbTreeWalk walk,
                           VdbTreeWalk::open(*file_, grid_, vdbValueType(grid_).value()));
  VdbBlock block;
  VdbCoord least = {}, greatest = {};
  count = 0;
  while (true) {
    SURFEIT_ASSIGN_OR_RETURN(const bool found, walk.next(block));
    if (!found) break;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int32_t last = block.origin[axis] + (block.size - 1);
      least[axis] = count == 0 ? block.origin[axis] : std::min(least[axis], block.origin[axis]);
      greatest[axis] = count == 0 ? last : std::max(greatest[axis], last);
    }
    count += block.voxelCount();
    if (count > kMostVoxels) {
      return Status::corruption(fmt::format("{}: grid {} has more than 2^60 active voxels", path(),
                                            quoteText(grid_.name)));
    }
  }
  position_type = vdbPositionType(grid_.transform, least, greatest);
  return {};
}

Status VdbVolumeReader::declareVolume(const VdbGrid& grid, const std::string& name,
                                      const RowReaderOptions& options) {
  Volume volume;
  volume.grid = &grid;
  volume.type = vdbValueType(grid).value();
  volume.offset = element_.row_bytes;
  const std::size_t before = element_.properties.size();
  const std::vector<std::string> names = propertyNames(
      name, volume.type.components, vdbChannelKind(name, volume.type.components), options.channels);
  const bool is_taken = std::any_of(names.begin(), names.end(), [&](const std::string& property) {
    return element_.find(property) != nullptr;
  });
  if (is_taken) {
    notes_.push_back(
        fmt::format("grid {}: its name is taken, it is not read", quoteText(grid.name)));
  } else {
    SURFEIT_RETURN_IF_ERROR(addChannel(name, volume.type.components,
                                       vdbChannelKind(name, volume.type.components),
                                       volume.type.type, options.channels, path(), element_));
  }
  volume.is_in_rows = element_.properties.size() > before;
  if (volume.is_in_rows || &grid == &grid_) volumes_.push_back(std::move(volume));
  return {};
}

Status VdbVolumeReader::declare(const RowReaderOptions& options) {
  element_.name = "vertex";
  if (std::string note = noteOfBytesBehind(file_->bytes_behind, "grid"); !note.empty()) {
    notes_.push_back(std::move(note));
  }
  SURFEIT_RETURN_IF_ERROR(countVoxels(element_.count, position_type_));
  const auto add = [&](const char* name, std::size_t components, ChannelKind kind, ValueType type,
                       std::size_t& offset, bool& is_there) {
    offset = element_.row_bytes;
    const std::size_t before = element_.properties.size();
    const Status status =
        addChannel(name, components, kind, type, options.channels, path(), element_);
    is_there = element_.properties.size() > before;
    return status;
  };
  SURFEIT_RETURN_IF_ERROR(
      add("P", 3, ChannelKind::kPoint, position_type_, position_offset_, has_position_));
  SURFEIT_RETURN_IF_ERROR(
      add("radius", 1, ChannelKind::kFloat, ValueType::kFloat32, radius_offset_, has_radius_));

  // Which voxel it is keeps its name whatever is renamed
  voxel_offset_ = element_.row_bytes;
  for (const char* name : kVoxelNames) {
    SURFEIT_RETURN_IF_ERROR(
        addChannel(name, 1, ChannelKind::kFloat, ValueType::kInt32, {}, path(), element_));
  }
  has_voxel_ = true;

  const std::string own_name =
      isLevelSet(grid_) ? "distance" : (grid_.name.empty() ? "density" : grid_.name);
  SURFEIT_RETURN_IF_ERROR(declareVolume(grid_, own_name, options));
  std::size_t other_transforms = 0;
  std::string other_name;
  for (const VdbGrid& grid : file_->grids) {
    if (&grid == &grid_) continue;
    if (grid.isPoints() || !vdbValueType(grid).has_value()) {
      notes_.push_back(fmt::format("grid {} of type {} is not read", quoteText(grid.name),
                                   quoteText(grid.type)));
    } else if (grid.transform != grid_.transform) {
      if (++other_transforms == 1) other_name = quoteText(grid.name);
    } else if (volumes_.size() >= kMaxVolumes) {
      notes_.push_back(fmt::format("grid {}: after {} others it is not read", quoteText(grid.name),
                                   volumes_.size()));
    } else {
      SURFEIT_RETURN_IF_ERROR(declareVolume(grid, grid.name, options));
    }
  }
  if (other_transforms > 0) {
    notes_.push_back(
        fmt::format("grids with other transforms are not read, {} and {} more: read them by name",
                    other_name, other_transforms - 1));
  }
  return rewind();
}

Status VdbVolumeReader::rewind() {
  failure_ = {};
  rows_left_ = element_.count;
  rows_.clear();
  rows_next_ = 0;
  next_part_ = 0;
  for (Volume& volume : volumes_) {
    SURFEIT_ASSIGN_OR_RETURN(volume.walk, VdbTreeWalk::open(*file_, *volume.grid, volume.type));
    volume.buffers = VdbCursor(file_->input, volume.grid->buffers_begin, volume.grid->end);
    SURFEIT_RETURN_IF_ERROR(nextBlock(volume));
  }
  return {};
}

Status VdbVolumeReader::nextBlock(Volume& volume) const {
  SURFEIT_ASSIGN_OR_RETURN(volume.has_block, volume.walk->next(volume.block));
  if (!volume.has_block || !volume.block.is_leaf) return {};
  VdbLeafMask mask = {};
  SURFEIT_RETURN_IF_ERROR(volume.buffers.read(mask));
  if (mask != volume.block.mask) {
    return volume.buffers.corrupt("the mask of a leaf differs from that in the tree");
  }
  return readVdbActiveValues(volume.buffers, volume.grid->compression, volume.type, mask,
                             volume.values);
}

// Positions, radii and indices of the voxels of mask_ at origin_.
void VdbVolumeReader::placeVoxels() {
  const double radius = std::cbrt(grid_.transform.volume() * 3 / (4 * std::numbers::pi));
  const float radius_row = static_cast<float>(radius);
  forActive(mask_, [&](std::size_t voxel, std::size_t number) {
    std::byte* row = rows_.data() + number * element_.row_bytes;
    const VdbCoord index = {origin_[0] + static_cast<std::int32_t>(voxel >> 6),
                            origin_[1] + static_cast<std::int32_t>((voxel >> 3) & 7),
                            origin_[2] + static_cast<std::int32_t>(voxel & 7)};
    std::memcpy(row + voxel_offset_, index.data(), sizeof(index));
    if (has_radius_) std::memcpy(row + radius_offset_, &radius_row, sizeof(radius_row));
    if (!has_position_) return;
    const std::array<double, 3> world = grid_.transform.world(index[0], index[1], index[2]);
    if (position_type_ == ValueType::kFloat64) {
      std::memcpy(row + position_offset_, world.data(), sizeof(world));
    } else {
      const float narrow[3] = {static_cast<float>(world[0]), static_cast<float>(world[1]),
                               static_cast<float>(world[2])};
      std::memcpy(row + position_offset_, narrow, sizeof(narrow));
    }
  });
}

// The values of a grid at the voxels of mask_ at origin_. Grids are walked side by side: both are
// in the order of the tree.
Status VdbVolumeReader::placeValues(Volume& volume) {
  while (volume.has_block && !volume.block.contains(origin_) &&
         precedesInTree(volume.block.origin, origin_)) {
    SURFEIT_RETURN_IF_ERROR(nextBlock(volume));
  }
  if (!volume.is_in_rows) return {};
  const bool is_here = volume.has_block && volume.block.contains(origin_);
  const std::size_t bytes = volume.type.bytes;
  const std::byte* one_value = is_here && !volume.block.is_leaf ? volume.block.value.data()
                                                                : volume.walk->background().data();
  const VdbLeafMask none = {};
  const VdbLeafMask& active = is_here && volume.block.is_leaf ? volume.block.mask : none;
  std::size_t ranks[kVdbLeafVoxels / 64 + 1] = {};
  for (std::size_t word = 0; word < active.size(); ++word) {
    ranks[word + 1] = ranks[word] + static_cast<std::size_t>(std::popcount(active[word]));
  }
  forActive(mask_, [&](std::size_t voxel, std::size_t number) {
    const std::size_t word = voxel / 64;
    const std::uint64_t bit = std::uint64_t{1} << (voxel % 64);
    const std::byte* value = one_value;
    if ((active[word] & bit) != 0) {
      const std::size_t rank =
          ranks[word] + static_cast<std::size_t>(std::popcount(active[word] & (bit - 1)));
      value = volume.values.data() + rank * bytes;
    }
    std::memcpy(rows_.data() + number * element_.row_bytes + volume.offset, value, bytes);
  });
  return {};
}

// Makes the rows of the next leaf, or of the next 8^3 voxels of a tile.
Status VdbVolumeReader::nextRows() {
  Volume& own = volumes_.front();
  if (!own.has_block) {
    return Status::corruption(fmt::format("{}: the tree ends {} voxels early", path(), rows_left_));
  }
  if (own.block.is_leaf) {
    origin_ = own.block.origin;
    mask_ = own.block.mask;
  } else {
    origin_ = partOrigin(own.block, next_part_);
    mask_.fill(~std::uint64_t{0});
  }
  std::size_t count = 0;
  for (const std::uint64_t word : mask_) count += static_cast<std::size_t>(std::popcount(word));
  rows_.resize(count * element_.row_bytes);
  rows_next_ = 0;
  placeVoxels();
  for (Volume& volume : volumes_) SURFEIT_RETURN_IF_ERROR(placeValues(volume));

  ++next_part_;
  if (own.block.is_leaf || next_part_ == partCount(own.block)) {
    next_part_ = 0;
    SURFEIT_RETURN_IF_ERROR(nextBlock(own));
  }
  return {};
}

Result<Bytes> VdbVolumeReader::readRows(std::size_t max_rows, AlignedBuffer& buffer) {
  if (!failure_.ok()) return failure_;
  const std::size_t bytes =
      static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, rows_left_)) * element_.row_bytes;
  buffer.reserve(bytes);
  for (std::size_t filled = 0; filled < bytes;) {
    while (rows_next_ == rows_.size()) {  // leaves may be without active voxels
      failure_ = nextRows();
      if (!failure_.ok()) return failure_;
    }
    const std::size_t part = std::min(bytes - filled, rows_.size() - rows_next_);
    std::memcpy(buffer.data() + filled, rows_.data() + rows_next_, part);
    filled += part;
    rows_next_ += part;
    rows_left_ -= part / element_.row_bytes;
  }
  if (rows_left_ == 0) failure_ = file_->input.checkUnchanged();
  if (!failure_.ok()) return failure_;
  return Bytes(buffer.data(), bytes);
}

}  // namespace surfeit
