#include "cloud/vdb/vdb_points_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "cloud/parts/bytes_behind.h"
#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_points_layout.h"
#include "cloud/vdb/vdb_tree.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxRowBytes = 16 << 10;

// An attribute that rows have.
struct Field {
  std::size_t attribute = 0;
  std::size_t offset = 0;  // in a row
  bool is_position = false;
};

// What has been read of the current leaf.
struct Leaf {
  VdbBlock block;
  std::vector<VdbArrayRecord> records;
  std::array<std::uint32_t, kVdbLeafVoxels> ends = {};  // of the points of each voxel
  std::vector<Bytes> arrays;                            // by field
  std::uint32_t next = 0, size = 0;                     // points
  std::size_t voxel = 0;                                // of the next point
};

class VdbPointsReader final : public RowReader {
 public:
  VdbPointsReader(std::shared_ptr<const VdbFile> file, const VdbGrid& grid, VdbPointsLayout layout)
      : file_(std::move(file)), grid_(grid), layout_(std::move(layout)) {}

  Status declare(const RowReaderOptions& options);

  const std::string& path() const override { return file_->input.path(); }
  std::string formatName() const override { return "OpenVDB points"; }
  const RowLayout& element() const override { return element_; }
  std::vector<std::string> comments() const override { return vdbComments(*file_); }
  std::vector<std::string> notes() const override { return notes_; }
  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override;
  Status rewind() override;

 private:
  Status declareAttribute(std::size_t index, const RowReaderOptions& options);
  Status readLeaf();
  Status readVoxels();
  Status readSome(std::span<std::byte> rows, std::size_t& filled);
  void decodePositions(const Field& field, Bytes array, std::uint32_t begin, std::uint32_t count,
                       std::byte* rows);

  std::shared_ptr<const VdbFile> file_;
  const VdbGrid& grid_;
  VdbPointsLayout layout_;
  RowLayout element_;
  std::vector<Field> fields_;
  std::vector<std::string> notes_;

  std::optional<VdbTreeWalk> walk_;
  VdbArrayRecords records_;
  VdbCursor voxels_;
  std::vector<VdbArrayStream> streams_;  // by field
  Leaf leaf_;
  std::uint64_t rows_left_ = 0;
  std::vector<double> positions_;
  Status failure_;
};

// Where an attribute stands in a row, by its name.
Status VdbPointsReader::declareAttribute(std::size_t index, const RowReaderOptions& options) {
  const VdbAttribute& attribute = layout_.attributes[index];
  if (!attribute.type.has_value()) {
    notes_.push_back(fmt::format("attribute {} of type {} ({}) is not read",
                                 quoteText(attribute.name), quoteText(attribute.value_type),
                                 quoteText(attribute.codec)));
    return {};
  }
  const std::size_t components = attribute.type->components * attribute.stride;
  Field field{index, element_.row_bytes, attribute.name == "P" && components == 3};
  const ValueType type = field.is_position
                             ? vdbPositionType(grid_.transform, layout_.least, layout_.greatest)
                             : attribute.type->type;
  if (element_.row_bytes + components * valueTypeBytes(type) > kMaxRowBytes) {
    return Status::corruption(
        fmt::format("{}: attribute {} of {} values: points of more than {} bytes, expected fewer",
                    path(), quoteText(attribute.name), components, kMaxRowBytes));
  }
  const std::size_t before = element_.properties.size();
  SURFEIT_RETURN_IF_ERROR(addChannel(attribute.name, components,
                                     vdbChannelKind(attribute.name, components), type,
                                     options.channels, path(), element_));
  if (element_.properties.size() == before) return {};
  const StoredType stored = attribute.type->stored;
  if (stored == StoredType::kInt64 || stored == StoredType::kUint64) {
    notes_.push_back(fmt::format("64-bit integers become float64: {}", quoteText(attribute.name)));
  }
  fields_.push_back(field);
  return {};
}

Status VdbPointsReader::declare(const RowReaderOptions& options) {
  element_.name = "vertex";
  element_.count = layout_.point_count;
  if (std::string note = noteOfBytesBehind(file_->bytes_behind, "grid"); !note.empty()) {
    notes_.push_back(std::move(note));
  }
  const auto& attributes = layout_.attributes;
  const auto position = std::find_if(attributes.begin(), attributes.end(), [](const auto& a) {
    return a.name == "P" && a.type.has_value() && a.type->components * a.stride == 3;
  });
  if (position == attributes.end() && !attributes.empty()) {
    return Status::corruption(fmt::format("{}: grid {} has no attribute P of three components",
                                          path(), quoteText(grid_.name)));
  }

  // Positions first, also those of no points
  if (attributes.empty()) {
    return addChannel("P", 3, ChannelKind::kPoint, ValueType::kFloat32, options.channels, path(),
                      element_);
  }
  const std::size_t position_index = static_cast<std::size_t>(position - attributes.begin());
  SURFEIT_RETURN_IF_ERROR(declareAttribute(position_index, options));
  for (std::size_t i = 0; i < attributes.size(); ++i) {
    if (i != position_index) SURFEIT_RETURN_IF_ERROR(declareAttribute(i, options));
  }
  return rewind();
}

Status VdbPointsReader::rewind() {
  failure_ = {};
  rows_left_ = layout_.point_count;
  leaf_ = {};
  streams_.clear();
  if (layout_.leaf_count == 0) return {};
  SURFEIT_ASSIGN_OR_RETURN(walk_, VdbTreeWalk::open(*file_, grid_, vdbValueType(grid_).value()));
  records_ = VdbArrayRecords(VdbCursor(file_->input, layout_.records_begin, grid_.end));
  voxels_ = VdbCursor(file_->input, layout_.voxels_begin, grid_.end);
  for (const Field& field : fields_) {
    streams_.emplace_back(*file_, grid_, layout_.attributes[field.attribute]);
  }
  return {};
}

// Where the points of each voxel of a leaf end: they only grow, up to the size of the arrays.
Status VdbPointsReader::readVoxels() {
  SURFEIT_RETURN_IF_ERROR(voxels_.skip(sizeof(VdbLeafMask)));
  std::uint16_t size = 0;
  SURFEIT_RETURN_IF_ERROR(voxels_.read(size));
  if (size == 0xFFFF) {
    SURFEIT_RETURN_IF_ERROR(voxels_.read(leaf_.ends));
  } else {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes packed, voxels_.take(size));
    if (!unpackBlosc(packed, std::as_writable_bytes(std::span(leaf_.ends)))) {
      return voxels_.corrupt("voxel offsets that do not unpack");
    }
  }
  if (!std::is_sorted(leaf_.ends.begin(), leaf_.ends.end()) || leaf_.ends.back() != leaf_.size) {
    return voxels_.corrupt(fmt::format("voxels end at point {}, expected {}, in rising order",
                                       leaf_.ends.back(), leaf_.size));
  }
  return {};
}

Status VdbPointsReader::readLeaf() {
  do {
    SURFEIT_ASSIGN_OR_RETURN(const bool found, walk_->next(leaf_.block));
    if (!found) {
      return Status::corruption(fmt::format("{}: leaves end {} points early", path(), rows_left_));
    }
  } while (!leaf_.block.is_leaf);
  SURFEIT_RETURN_IF_ERROR(records_.next(leaf_.records));
  leaf_.next = 0;
  leaf_.voxel = 0;
  leaf_.size = leaf_.records[0].size;
  SURFEIT_RETURN_IF_ERROR(readVoxels());
  leaf_.arrays.resize(fields_.size());
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    SURFEIT_ASSIGN_OR_RETURN(leaf_.arrays[i],
                             streams_[i].next(leaf_.records[fields_[i].attribute]));
  }
  return {};
}

// Positions are stored relative to the centres of voxels, in voxels.
void VdbPointsReader::decodePositions(const Field& field, Bytes array, std::uint32_t begin,
                                      std::uint32_t count, std::byte* rows) {
  const VdbAttribute& attribute = layout_.attributes[field.attribute];
  const bool is_uniform = leaf_.records[field.attribute].is_uniform;
  const bool is_wide = attribute.type->type == ValueType::kFloat64;
  const std::size_t value_bytes = 3 * valueTypeBytes(attribute.type->type);
  const bool is_wide_row = element_.properties[0].type == ValueType::kFloat64;
  positions_.resize(std::size_t{3} * count);
  std::byte* decoded = reinterpret_cast<std::byte*>(positions_.data());
  const std::size_t first = is_uniform ? 0 : begin * attribute.type->value_bytes * attribute.stride;
  decodeVdbAttribute(*attribute.type, array.data() + first, is_uniform, count, attribute.stride,
                     decoded, value_bytes);

  std::size_t voxel = leaf_.voxel;
  for (std::uint32_t i = 0; i < count; ++i) {
    while (leaf_.ends[voxel] <= begin + i) ++voxel;
    double local[3];
    if (is_wide) {
      std::memcpy(local, decoded + i * value_bytes, sizeof(local));
    } else {
      float narrow[3];
      std::memcpy(narrow, decoded + i * value_bytes, sizeof(narrow));
      std::copy_n(narrow, 3, local);
    }
    const VdbCoord& origin = leaf_.block.origin;
    const std::array<double, 3> world =
        grid_.transform.world(origin[0] + static_cast<double>(voxel >> 6) + local[0],
                              origin[1] + static_cast<double>((voxel >> 3) & 7) + local[1],
                              origin[2] + static_cast<double>(voxel & 7) + local[2]);
    std::byte* out = rows + i * element_.row_bytes + field.offset;
    if (is_wide_row) {
      std::memcpy(out, world.data(), sizeof(world));
    } else {
      const float narrow[3] = {static_cast<float>(world[0]), static_cast<float>(world[1]),
                               static_cast<float>(world[2])};
      std::memcpy(out, narrow, sizeof(narrow));
    }
  }
}

// Appends points of the current leaf, or of the next one, to `rows`.
Status VdbPointsReader::readSome(std::span<std::byte> rows, std::size_t& filled) {
  if (leaf_.next == leaf_.size) {
    SURFEIT_RETURN_IF_ERROR(readLeaf());
    if (leaf_.size > rows_left_) return voxels_.corrupt("a leaf of more points than are left");
  }
  const std::uint32_t begin = leaf_.next;
  const std::uint32_t count = static_cast<std::uint32_t>(
      std::min<std::size_t>(leaf_.size - begin, (rows.size() - filled) / element_.row_bytes));
  if (count == 0) return {};
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const Field& field = fields_[i];
    const VdbAttribute& attribute = layout_.attributes[field.attribute];
    const Bytes array = leaf_.arrays[i];
    if (field.is_position) {
      decodePositions(field, array, begin, count, rows.data() + filled);
      continue;
    }
    const bool is_uniform = leaf_.records[field.attribute].is_uniform;
    const std::size_t first =
        is_uniform ? 0 : begin * attribute.type->value_bytes * attribute.stride;
    decodeVdbAttribute(*attribute.type, array.data() + first, is_uniform, count, attribute.stride,
                       rows.data() + filled + field.offset, element_.row_bytes);
  }
  leaf_.next += count;
  rows_left_ -= count;
  filled += count * element_.row_bytes;
  while (leaf_.voxel + 1 < kVdbLeafVoxels && leaf_.ends[leaf_.voxel] <= leaf_.next) ++leaf_.voxel;
  return {};
}

Result<Bytes> VdbPointsReader::readRows(std::size_t max_rows, AlignedBuffer& buffer) {
  if (!failure_.ok()) return failure_;
  const std::size_t bytes =
      static_cast<std::size_t>(std::min<std::uint64_t>(max_rows, rows_left_)) * element_.row_bytes;
  buffer.reserve(bytes);
  const std::span<std::byte> rows(buffer.data(), bytes);
  for (std::size_t filled = 0; filled < bytes;) {
    failure_ = readSome(rows, filled);
    if (!failure_.ok()) return failure_;
  }
  if (rows_left_ == 0) failure_ = file_->input.checkUnchanged();
  if (!failure_.ok()) return failure_;
  return Bytes(rows);
}

}  // namespace

ValueType vdbPositionType(const VdbTransform& transform, const VdbCoord& least,
                          const VdbCoord& greatest) {
  // The largest coordinate of a corner, and the edge of a voxel
  double most = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const std::array<double, 3> world = transform.world((corner & 1) != 0 ? least[0] : greatest[0],
                                                        (corner & 2) != 0 ? least[1] : greatest[1],
                                                        (corner & 4) != 0 ? least[2] : greatest[2]);
    for (const double value : world) most = std::max(most, std::abs(value));
  }
  constexpr double kMostVoxels = 4096;  // 24 bits less 12
  return most <= kMostVoxels * std::cbrt(transform.volume()) ? ValueType::kFloat32
                                                             : ValueType::kFloat64;
}

std::vector<std::string> vdbComments(const VdbFile& file) {
  std::vector<std::string> comments;
  for (const VdbMetadata& entry : file.metadata) {
    if (entry.name.starts_with("comment")) comments.push_back(entry.text());
  }
  return comments;
}

Result<std::unique_ptr<RowReader>> openVdbPoints(std::shared_ptr<const VdbFile> file,
                                                 const VdbGrid& grid,
                                                 const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(VdbPointsLayout layout, VdbPointsLayout::read(*file, grid));
  auto reader = std::make_unique<VdbPointsReader>(std::move(file), grid, std::move(layout));
  SURFEIT_RETURN_IF_ERROR(reader->declare(options));
  return std::unique_ptr<RowReader>(std::move(reader));
}

}  // namespace surfeit
