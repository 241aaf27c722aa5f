#include "cloud/vdb/vdb_points_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_tree.h"

namespace surfeit {
namespace {

// Each has buffers of 128 KiB, and a page
constexpr std::uint64_t kMaxAttributes = 256;
// lz4, which OpenVDB packs with, makes 255 bytes of one at best
constexpr std::uint64_t kMostExpansion = 256;
constexpr std::size_t kVoxelBytes = 4 * kVdbLeafVoxels;
// In place of the size of voxel offsets that are not packed
constexpr std::uint16_t kNotPacked = 0xFFFF;
// A record's size counts this much of the record itself
constexpr std::uint64_t kCountedRecordBytes = 6;

struct PageSize {
  std::uint64_t stored = 0, unpacked = 0;
  bool is_packed = false;
};

Status readPageSize(VdbCursor& cursor, PageSize& size) {
  std::int32_t packed = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(packed));
  std::int32_t unpacked = packed;
  size.is_packed = packed > 0;
  if (size.is_packed) SURFEIT_RETURN_IF_ERROR(cursor.read(unpacked));
  size.unpacked = static_cast<std::uint64_t>(std::abs(static_cast<std::int64_t>(unpacked)));
  size.stored = size.is_packed ? static_cast<std::uint64_t>(packed) : size.unpacked;
  if (size.unpacked == 0 || (size.is_packed && unpacked < 0) || size.unpacked > kVdbMaxArrayBytes ||
      size.unpacked > kMostExpansion * size.stored) {
    return cursor.corrupt(fmt::format("a page of {} bytes unpacked from {}", unpacked, packed));
  }
  return {};
}

// Passes over the page sizes of an attribute; `data_bytes` becomes the bytes of its pages.
Status skipPageSizes(VdbCursor& cursor, const VdbAttribute& attribute, std::uint64_t& data_bytes) {
  data_bytes = 0;
  for (std::uint64_t unpacked = 0; unpacked < attribute.bytes;) {
    PageSize page;
    SURFEIT_RETURN_IF_ERROR(readPageSize(cursor, page));
    unpacked += page.unpacked;
    data_bytes += page.stored;
    if (unpacked > attribute.bytes) {
      return cursor.corrupt(fmt::format("attribute {}: pages of {} bytes, expected {}",
                                        quoteText(attribute.name), unpacked, attribute.bytes));
    }
  }
  return {};
}

}  // namespace

Status VdbArrayRecords::readDescriptor() {
  std::vector<VdbAttribute> attributes;
  std::uint64_t count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(count));
  if (count == 0 || count > kMaxAttributes) {
    return cursor_.corrupt(fmt::format("{} attributes, expected 1 to {}", count, kMaxAttributes));
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    VdbAttribute attribute;
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(attribute.value_type));
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(attribute.codec));
    attribute.type = vdbAttributeType(attribute.value_type, attribute.codec);
    attributes.push_back(std::move(attribute));
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    std::string name;
    std::uint64_t index = 0;
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(name));
    SURFEIT_RETURN_IF_ERROR(cursor_.read(index));
    if (index >= count || name.empty() || !attributes[index].name.empty()) {
      return cursor_.corrupt(
          fmt::format("attribute {} is number {} of {}", quoteText(name), index, count));
    }
    attributes[index].name = std::move(name);
  }

  // Groups and metadata (default values) are passed over
  std::uint64_t group_count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(group_count));
  std::string text;
  for (std::uint64_t i = 0; i < group_count; ++i) {
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(text));
    SURFEIT_RETURN_IF_ERROR(cursor_.skip(sizeof(std::uint64_t)));
  }
  std::uint32_t metadata_count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(metadata_count));
  for (std::uint32_t i = 0; i < metadata_count; ++i) {
    std::uint32_t bytes = 0;
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(text));
    SURFEIT_RETURN_IF_ERROR(cursor_.readText(text));
    SURFEIT_RETURN_IF_ERROR(cursor_.read(bytes));
    SURFEIT_RETURN_IF_ERROR(cursor_.skip(bytes));
  }

  if (is_first_) attributes_ = std::move(attributes);
  const auto same = [](const VdbAttribute& a, const VdbAttribute& b) {
    return a.name == b.name && a.value_type == b.value_type && a.codec == b.codec;
  };
  if (!is_first_ && !std::equal(attributes.begin(), attributes.end(), attributes_.begin(),
                                attributes_.end(), same)) {
    return cursor_.corrupt("a leaf has other attributes than the first leaf");
  }
  return {};
}

Status VdbArrayRecords::readRecord(VdbArrayRecord& record) {
  std::uint64_t bytes = 0;
  std::uint8_t flags = 0, how = 0;
  SURFEIT_RETURN_IF_ERROR(cursor_.read(bytes));
  SURFEIT_RETURN_IF_ERROR(cursor_.read(flags));
  SURFEIT_RETURN_IF_ERROR(cursor_.read(how));
  SURFEIT_RETURN_IF_ERROR(cursor_.read(record.size));
  record.stride = 1;
  if ((how & kVdbStrided) != 0) SURFEIT_RETURN_IF_ERROR(cursor_.read(record.stride));
  const bool varies = (how & kVdbStrided) != 0 && (flags & kVdbConstantStride) == 0;
  if (how >= 2 * kVdbPaged || (how & kVdbPackedInMemory) != 0 || varies) {
    return cursor_.corrupt(fmt::format("an array with flags {:#x}, {:#x}: not read", flags, how));
  }
  if (bytes < kCountedRecordBytes || bytes > std::uint64_t{1} << 40 || record.stride == 0 ||
      record.stride > 1024) {
    return cursor_.corrupt(
        fmt::format("an array of {} bytes, {} values per point", bytes, record.stride));
  }
  record.bytes = bytes - kCountedRecordBytes;
  record.is_uniform = (how & kVdbUniform) != 0;
  record.is_paged = (how & kVdbPaged) != 0;
  return {};
}

Status VdbArrayRecords::next(std::vector<VdbArrayRecord>& records) {
  if (!is_shared_) {
    // Bit 0: a descriptor for all leaves; bit 1: bytes of a later version follow it
    std::uint8_t header = 0;
    SURFEIT_RETURN_IF_ERROR(cursor_.read(header));
    if (header > 3) return cursor_.corrupt(fmt::format("a descriptor with flags {}", header));
    SURFEIT_RETURN_IF_ERROR(readDescriptor());
    if ((header & 2) != 0) {
      std::uint64_t bytes = 0;
      SURFEIT_RETURN_IF_ERROR(cursor_.read(bytes));
      SURFEIT_RETURN_IF_ERROR(cursor_.skip(bytes));
    }
    is_shared_ = (header & 1) != 0;
  }
  records.resize(attributes_.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    VdbArrayRecord& record = records[i];
    VdbAttribute& attribute = attributes_[i];
    SURFEIT_RETURN_IF_ERROR(readRecord(record));
    if (is_first_) {
      attribute.stride = record.stride;
      attribute.is_paged = record.is_paged;
    }
    if (record.stride != attribute.stride || record.is_paged != attribute.is_paged ||
        record.size != records[0].size) {
      return cursor_.corrupt(fmt::format(
          "attribute {}: {} points of {} values, expected {} of {} as of its neighbours",
          quoteText(attribute.name), record.size, record.stride, records[0].size,
          attribute.stride));
    }
    if (attribute.type.has_value() && (record.is_paged || record.is_uniform)) {
      const std::uint64_t values =
          record.is_uniform ? 1 : std::uint64_t{record.size} * record.stride;
      if (record.bytes != values * attribute.type->value_bytes) {
        return cursor_.corrupt(fmt::format("attribute {}: {} bytes for {} values of {}",
                                           quoteText(attribute.name), record.bytes, values,
                                           attribute.type->value_bytes));
      }
    }
    attribute.bytes += record.bytes;
  }
  is_first_ = false;
  return {};
}

Result<VdbPointsLayout> VdbPointsLayout::read(const VdbFile& file, const VdbGrid& grid) {
  VdbPointsLayout layout;
  SURFEIT_ASSIGN_OR_RETURN(VdbTreeWalk walk,
                           VdbTreeWalk::open(file, grid, vdbValueType(grid).value()));
  VdbBlock block;
  while (true) {
    SURFEIT_ASSIGN_OR_RETURN(const bool found, walk.next(block));
    if (!found) break;
    if (!block.is_leaf) continue;  // a tile holds no points
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int32_t last = block.origin[axis] + kVdbLeafSize - 1;
      layout.least[axis] = layout.leaf_count == 0
                               ? block.origin[axis]
                               : std::min(layout.least[axis], block.origin[axis]);
      layout.greatest[axis] = layout.leaf_count == 0 ? last : std::max(layout.greatest[axis], last);
    }
    ++layout.leaf_count;
  }
  if (layout.leaf_count == 0) return layout;

  // Sizes of voxel offsets
  VdbCursor cursor(file.input, grid.buffers_begin, grid.end);
  std::uint16_t pass_count = 0;
  SURFEIT_RETURN_IF_ERROR(cursor.read(pass_count));
  std::uint64_t voxel_bytes = 0;
  for (std::uint64_t leaf = 0; leaf < layout.leaf_count; ++leaf) {
    std::uint16_t size = 0;
    SURFEIT_RETURN_IF_ERROR(cursor.read(size));
    voxel_bytes += sizeof(VdbLeafMask) + sizeof(size) + (size == kNotPacked ? kVoxelBytes : size);
  }

  // What the arrays are
  layout.records_begin = cursor.offset();
  VdbArrayRecords records(std::move(cursor));
  std::vector<VdbArrayRecord> leaf_records;
  std::vector<std::uint64_t> unpaged_bytes;
  for (std::uint64_t leaf = 0; leaf < layout.leaf_count; ++leaf) {
    SURFEIT_RETURN_IF_ERROR(records.next(leaf_records));
    unpaged_bytes.resize(leaf_records.size());
    for (std::size_t i = 0; i < leaf_records.size(); ++i) {
      unpaged_bytes[i] += leaf_records[i].bytes + (leaf_records[i].is_uniform ? 0 : 1);
    }
    layout.point_count += leaf_records[0].size;
  }
  layout.attributes = records.attributes();

  // Sizes of pages, then where all data lies
  cursor = VdbCursor(file.input, records.offset(), grid.end);
  const std::size_t expected_passes = 4 + 2 * layout.attributes.size();
  if (pass_count != expected_passes) {
    return cursor.corrupt(fmt::format("{} passes over {} attributes, expected {}", pass_count,
                                      layout.attributes.size(), expected_passes));
  }
  std::vector<std::uint64_t> data_bytes = unpaged_bytes;
  for (std::size_t i = 0; i < layout.attributes.size(); ++i) {
    VdbAttribute& attribute = layout.attributes[i];
    attribute.sizes_begin = cursor.offset();
    if (!attribute.is_paged) continue;
    SURFEIT_RETURN_IF_ERROR(skipPageSizes(cursor, attribute, data_bytes[i]));
  }
  layout.voxels_begin = cursor.offset();
  SURFEIT_RETURN_IF_ERROR(cursor.skip(voxel_bytes));
  for (std::size_t i = 0; i < layout.attributes.size(); ++i) {
    layout.attributes[i].data_begin = cursor.offset();
    SURFEIT_RETURN_IF_ERROR(cursor.skip(data_bytes[i]));
  }
  return layout;
}

VdbArrayStream::VdbArrayStream(const VdbFile& file, const VdbGrid& grid,
                               const VdbAttribute& attribute)
    : sizes_(file.input, attribute.sizes_begin, grid.end),
      data_(file.input, attribute.data_begin, grid.end),
      type_(*attribute.type) {}

Status VdbArrayStream::readPage() {
  PageSize size;
  SURFEIT_RETURN_IF_ERROR(readPageSize(sizes_, size));
  SURFEIT_ASSIGN_OR_RETURN(const Bytes stored, data_.take(size.stored));
  page_.resize(static_cast<std::size_t>(size.unpacked));
  position_ = 0;
  if (!size.is_packed) {
    std::copy(stored.begin(), stored.end(), page_.begin());
  } else if (!unpackBlosc(stored, page_)) {
    page_.clear();
    return data_.corrupt("a page that does not unpack");
  }
  return {};
}

Result<Bytes> VdbArrayStream::readUnpaged(const VdbArrayRecord& record) {
  if (record.is_uniform) return data_.take(record.bytes);
  std::uint8_t is_packed = 0;
  SURFEIT_RETURN_IF_ERROR(data_.read(is_packed));
  const std::uint64_t bytes = std::uint64_t{record.size} * record.stride * type_.value_bytes;
  if (is_packed == 0 && bytes == record.bytes) return data_.take(bytes);
  if (is_packed != 1 || bytes > kVdbMaxArrayBytes || bytes > kMostExpansion * record.bytes) {
    return data_.corrupt(fmt::format("an array of {} bytes in {}", bytes, record.bytes));
  }
  SURFEIT_ASSIGN_OR_RETURN(const Bytes stored, data_.take(record.bytes));
  page_.resize(static_cast<std::size_t>(bytes));
  if (!unpackBlosc(stored, page_)) return data_.corrupt("an array that does not unpack");
  return Bytes(page_);
}

Result<Bytes> VdbArrayStream::next(const VdbArrayRecord& record) {
  if (!record.is_paged) return readUnpaged(record);
  if (record.bytes == 0) return Bytes();
  if (position_ == page_.size()) SURFEIT_RETURN_IF_ERROR(readPage());
  if (record.bytes > page_.size() - position_) {
    return data_.corrupt(fmt::format("an array of {} bytes, {} are left of its page", record.bytes,
                                     page_.size() - position_));
  }
  const Bytes array = Bytes(page_).subspan(position_, static_cast<std::size_t>(record.bytes));
  position_ += array.size();
  return array;
}

}  // namespace surfeit
