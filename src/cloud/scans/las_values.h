// Numbers of a LAS record (ASPRS, LAS 1.0 to 1.5) and the numbers of rows that they become: whole
// bytes, scaled integers, and a few bits of a byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"

namespace surfeit {

// As data types of extra bytes are numbered.
enum class LasType : std::uint8_t {
  kBytes,  // without a meaning
  kUint8,
  kInt8,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kUint64,
  kInt64,
  kFloat32,
  kFloat64
};
std::size_t lasTypeBytes(LasType type);
// The type of rows that holds such values; 64-bit integers become float64, exact to 2^53.
ValueType plyTypeOf(LasType type);
LasType lasTypeOf(ValueType type);

// What a record has, of one to three numbers, or many bytes.
struct LasField {
  std::string name;  // "return_number", or as the file describes extra bytes
  std::size_t components = 1;
  ChannelKind kind = ChannelKind::kFloat;
  ValueType type = ValueType::kUint8;  // of rows
  LasType stored = LasType::kUint8;
  std::size_t offset = 0;             // in the record
  unsigned shift = 0, bit_count = 0;  // of a byte; 0 bits: whole values
  bool is_scaled = false;             // value = stored * scale + origin
  std::array<double, 3> scale{1, 1, 1}, origin{};
  bool is_extra = false;  // extra bytes
  // Of these the description in the header, counted from 0; nothing when there is none.
  std::optional<std::size_t> descriptor;

  std::size_t bytes() const { return components * lasTypeBytes(stored); }
};

// What the point format has, without extra bytes: position, intensity, classification and color
// first.
std::vector<LasField> lasFields(unsigned point_format);
inline constexpr unsigned kLasPointFormats = 11;
// Bytes of a record without extra bytes.
std::size_t lasRecordBytes(unsigned point_format);

// One number of a record and the place of its value in a row.
struct LasValue {
  LasValue(const LasField& field, std::size_t component, std::size_t row_offset,
           ValueType row_type);

  std::size_t record_offset, row_offset;
  LasType stored;
  ValueType type;
  unsigned shift, bit_count;
  bool is_scaled;
  double scale, origin;
};

// The value of `count` records becomes that of as many rows.
void decodeLas(const LasValue& value, const std::byte* records, std::size_t record_bytes,
               std::size_t count, std::byte* rows, std::size_t row_bytes);
// The other way round, to records whose bits are 0. Returns how many values the record cannot hold:
// they become the nearest that it can, not a number 0.
std::size_t encodeLas(const LasValue& value, const std::byte* rows, std::size_t row_bytes,
                      std::size_t count, std::byte* records, std::size_t record_bytes);
// Whether such values of rows can be stored without a change: of unscaled integers.
struct LasRange {
  double least, most;
};
LasRange lasRange(LasType stored, unsigned bit_count);

}  // namespace surfeit
