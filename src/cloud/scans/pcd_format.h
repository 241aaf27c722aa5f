// The header of PCD files, the point clouds of PCL: lines of a word and its values, up to DATA.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/parts/stored_values.h"
#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// More values than any descriptor of PCL has; keeps the properties of a row few.
inline constexpr std::size_t kMaxPcdValues = 4096;
inline constexpr std::size_t kMaxPcdRecordBytes = 1 << 20;

// A field of every point: `count` values of one type. "_" is padding.
struct PcdField {
  std::string name;
  StoredType type = StoredType::kFloat32;
  std::size_t count = 1;

  bool isPadding() const { return name == "_"; }
  // Three or four bytes in one number: [ alpha : 8 | red : 8 | green : 8 | blue : 8 ].
  bool isPackedColor() const;
};

struct PcdHeader {
  std::string version;
  std::vector<PcdField> fields;
  std::uint64_t count = 0;
  std::optional<std::uint64_t> grid_count;  // width times height, where count is another
  bool has_view_point = false;              // other than the origin
  bool is_text = false;
  bool is_compressed = false;                    // by LZF, field by field; then no text
  std::uint64_t data_offset = 0, data_line = 1;  // of the first point
};

bool recognisesPcd(std::string_view first_bytes);

// kCorruption naming the line, what was found and what was expected.
Result<PcdHeader> readPcdHeader(ByteInput& input);

}  // namespace surfeit
