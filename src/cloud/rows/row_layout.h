// How a row of a cloud lies in memory: its properties, their types and places. Every reader fills
// rows of one layout, whatever the format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace surfeit {

// Types of values, with the names of PLY; both spellings ("uchar", "uint8") are read.
enum class ValueType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat32,
  kFloat64
};

// Bytes of one value.
std::size_t valueTypeBytes(ValueType type);
// The classic spelling: char uchar short ushort int uint float double.
std::string_view valueTypeName(ValueType type);
std::optional<ValueType> valueTypeFromName(std::string_view name);

inline bool isFloatType(ValueType type) { return type >= ValueType::kFloat32; }

// The smallest type that holds the values of both exactly; float64 where none does.
ValueType widestType(ValueType a, ValueType b);

// Calls `visit` with std::type_identity<T>, T being the C++ type of the values, and returns
// what it returns.
template <typename Visit>
decltype(auto) visitValueType(ValueType type, Visit visit) {
  switch (type) {
    case ValueType::kInt8:
      return visit(std::type_identity<std::int8_t>());
    case ValueType::kUint8:
      return visit(std::type_identity<std::uint8_t>());
    case ValueType::kInt16:
      return visit(std::type_identity<std::int16_t>());
    case ValueType::kUint16:
      return visit(std::type_identity<std::uint16_t>());
    case ValueType::kInt32:
      return visit(std::type_identity<std::int32_t>());
    case ValueType::kUint32:
      return visit(std::type_identity<std::uint32_t>());
    case ValueType::kFloat32:
      return visit(std::type_identity<float>());
    case ValueType::kFloat64:
      break;
  }
  return visit(std::type_identity<double>());
}

// Whether a property or a group of rows may be called so: a word of at most 64 bytes without
// control characters, fit to stand in a message.
bool isPropertyName(std::string_view word);

// Integers of 64 bits in a file: rows have doubles, which are exact up to 2^53.
enum class WideInteger : std::uint8_t { kNone, kSigned, kUnsigned };

struct RowProperty {
  std::string name;
  ValueType type = ValueType::kFloat32;  // of the value, or of the items of a list
  bool is_list = false;
  ValueType count_type = ValueType::kUint8;  // of a list's length
  // Where the value stands in a row of the reader: packed, host byte order; lists take no bytes.
  std::size_t offset = 0;
  WideInteger wide = WideInteger::kNone;  // in the file, where the type is float64
  // What --channels must call it, where that is not the name: the file's, or the user's renaming.
  std::string typed = {};
  bool is_made = false;  // of several values of the file: --channels does not reach it
};

struct RowLayout {
  std::string name;
  std::uint64_t count = 0;
  std::vector<RowProperty> properties;
  std::size_t row_bytes = 0;  // of the scalar properties, packed

  bool hasLists() const;
  // The property of that name, or nullptr.
  const RowProperty* find(std::string_view property) const;
};

// The value at `bytes` (host byte order) as a double.
double rowValue(const std::byte* bytes, ValueType type);

// Packs the scalar properties of an element in order: sets their offsets and row_bytes.
void packRow(RowLayout& element);

// Turns one value round, in place.
void swapValue(std::byte* value, ValueType type);
// Turns every value of whole packed rows round, in place.
void swapRows(const RowLayout& element, std::span<std::byte> rows);

// Turns the bits of integers of 64 bits into doubles, in place.
void widenValue(std::byte* value, WideInteger wide);
// Those of whole packed rows.
void widenRows(const RowLayout& element, std::span<std::byte> rows);

// Text of a file as it may stand in a message: quoted, printable, at most 40 characters of it.
std::string quoteText(std::string_view text);

}  // namespace surfeit
