// Where the parts of an OpenVDB point grid lie. After the tree come its leaves' data in passes,
// each over all leaves: sizes of voxel offsets; what the arrays of attributes are; per attribute,
// the sizes of its pages; voxel offsets; per attribute, its pages. So a leaf's data is gathered by
// a cursor per pass, and memory does not grow with the grid.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cloud/vdb/vdb_attribute.h"
#include "cloud/vdb/vdb_cursor.h"
#include "cloud/vdb/vdb_file.h"
#include "surfeit/status.h"

namespace surfeit {

// What the file says of an attribute's array in a leaf.
struct VdbArrayRecord {
  std::uint64_t bytes = 0;   // stored; compressed, when not in pages and not uniform
  std::uint32_t size = 0;    // points
  std::uint32_t stride = 1;  // values per point
  bool is_uniform = false;   // one value for all
  bool is_paged = false;
};

struct VdbAttribute {
  std::string name, value_type, codec;
  std::optional<VdbAttributeType> type;  // nothing: not read
  std::uint32_t stride = 1;
  bool is_paged = false;
  std::uint64_t bytes = 0;                        // of all its arrays, by their records
  std::uint64_t sizes_begin = 0, data_begin = 0;  // places in the file
};

// Reads the records of one leaf after the other. One thread at a time.
class VdbArrayRecords {
 public:
  VdbArrayRecords() = default;
  explicit VdbArrayRecords(VdbCursor cursor) : cursor_(std::move(cursor)) {}

  // Of the next leaf. Leaves whose attributes differ from those of the first are kCorruption.
  Status next(std::vector<VdbArrayRecord>& records);
  // The attributes of the first leaf, in the order of their records.
  const std::vector<VdbAttribute>& attributes() const { return attributes_; }
  std::uint64_t offset() const { return cursor_.offset(); }

 private:
  Status readDescriptor();
  Status readRecord(VdbArrayRecord& record);

  VdbCursor cursor_;
  std::vector<VdbAttribute> attributes_;
  bool is_first_ = true, is_shared_ = false;
};

// One pass over the tree and what lies in front of the arrays.
struct VdbPointsLayout {
  // kCorruption when a part does not lie within the grid's part of the file.
  static Result<VdbPointsLayout> read(const VdbFile& file, const VdbGrid& grid);

  std::uint64_t leaf_count = 0, point_count = 0;
  VdbCoord least = {}, greatest = {};  // voxels, of leaves
  std::uint64_t records_begin = 0, voxels_begin = 0;
  std::vector<VdbAttribute> attributes;
};

// The arrays of one attribute, leaf by leaf. One thread at a time. Takes a page: 1 MiB, or as much
// as the largest leaf has.
class VdbArrayStream {
 public:
  VdbArrayStream() = default;
  VdbArrayStream(const VdbFile& file, const VdbGrid& grid, const VdbAttribute& attribute);

  // The array of the next leaf, decompressed; until the next call.
  Result<Bytes> next(const VdbArrayRecord& record);

 private:
  Status readPage();
  Result<Bytes> readUnpaged(const VdbArrayRecord& record);

  VdbCursor sizes_, data_;
  VdbAttributeType type_;
  std::vector<std::byte> page_;
  std::size_t position_ = 0;
};

}  // namespace surfeit
