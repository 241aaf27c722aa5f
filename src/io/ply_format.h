// The PLY header: element and property declarations, shared by reader and writer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "io/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

enum class PlyEncoding : std::uint8_t { kAscii, kBinaryLittleEndian, kBinaryBigEndian };

// Scalar types of PLY; both spellings ("uchar", "uint8") are read.
enum class PlyType : std::uint8_t {
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
std::size_t plyTypeBytes(PlyType type);
// The classic spelling: char uchar short ushort int uint float double.
std::string_view plyTypeName(PlyType type);
std::optional<PlyType> plyTypeFromName(std::string_view name);

inline bool isPlyFloat(PlyType type) { return type >= PlyType::kFloat32; }

// The smallest type that holds the values of both exactly; float64 where none does.
PlyType widestPlyType(PlyType a, PlyType b);

// Calls `visit` with std::type_identity<T>, T being the C++ type of values of a PLY type, and
// returns what it returns.
template <typename Visit>
decltype(auto) visitPlyType(PlyType type, Visit visit) {
  switch (type) {
    case PlyType::kInt8:
      return visit(std::type_identity<std::int8_t>());
    case PlyType::kUint8:
      return visit(std::type_identity<std::uint8_t>());
    case PlyType::kInt16:
      return visit(std::type_identity<std::int16_t>());
    case PlyType::kUint16:
      return visit(std::type_identity<std::uint16_t>());
    case PlyType::kInt32:
      return visit(std::type_identity<std::int32_t>());
    case PlyType::kUint32:
      return visit(std::type_identity<std::uint32_t>());
    case PlyType::kFloat32:
      return visit(std::type_identity<float>());
    case PlyType::kFloat64:
      break;
  }
  return visit(std::type_identity<double>());
}

// Whether an element or a property may be called so: a word of at most 64 bytes without control
// characters, fit to stand in a message.
bool isPlyName(std::string_view word);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;  // of the value, or of the items of a list
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // of a list's length
  // Where the value stands in a row of the reader: packed, host byte order; lists take no bytes.
  std::size_t offset = 0;
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  std::size_t row_bytes = 0;  // of the scalar properties, packed

  bool hasLists() const;
  // The property of that name, or nullptr.
  const PlyProperty* find(std::string_view property) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kBinaryLittleEndian;
  std::vector<std::string> comments;
  std::vector<PlyElement> elements;
  std::uint64_t data_offset = 0;  // first byte after "end_header\n"

  // Index of the element of that name, or nothing.
  std::optional<std::size_t> findElement(std::string_view element) const;
};

// The longest header that is read; real ones stay far below a page of text.
inline constexpr std::size_t kMaxPlyHeaderBytes = 1 << 20;

// Parses the header at the start of a file. `path` only names the file in messages; kCorruption
// messages name the line, what was found and what was expected. `text` holds the first bytes of
// the file, at least up to the end of the header; nothing is allocated from declared counts.
// Element names are unique, and so are the property names of an element; an element that has rows
// has properties. "obj_info" lines are dropped, and so are comments without text.
Result<PlyHeader> parsePlyHeader(std::string_view text, const std::string& path);
// The same from the file itself.
Result<PlyHeader> readPlyHeader(ByteInput& file);

// The header as it stands in a file, up to and including "end_header\n". Line ends in comments
// become spaces.
std::string formatPlyHeader(const PlyHeader& header);

// The value at `bytes` (host byte order) as a double.
double plyValue(const std::byte* bytes, PlyType type);

// Packs the scalar properties of an element in order: sets their offsets and row_bytes.
void packPlyRow(PlyElement& element);

// Whether the values of a binary file stand in the other byte order than this machine's.
bool needsByteSwap(PlyEncoding encoding);
// Turns one value round, in place.
void swapPlyValue(std::byte* value, PlyType type);
// Turns every value of whole packed rows round, in place.
void swapPlyRows(const PlyElement& element, std::span<std::byte> rows);

// Text of a file as it may stand in a message: quoted, printable, at most 40 characters of it.
std::string quotePlyText(std::string_view text);

}  // namespace surfeit
