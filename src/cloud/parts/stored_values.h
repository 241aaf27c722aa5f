// Values as formats store them: all number types of the field's formats, of either byte order,
// anywhere in a record, become the types of rows, in loops over many records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"

namespace surfeit {

enum class StoredType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat16,
  kFloat32,
  kFloat64
};

// Bytes of one value.
std::size_t storedBytes(StoredType type);
// "int64", "float16", ...
std::string_view storedTypeName(StoredType type);
// The type that rows have for it. Half floats become float. 64-bit integers become double, which is
// exact up to 2^53.
ValueType plyTypeOf(StoredType type);
// The type that stores values of rows as they are.
StoredType storedTypeOf(ValueType type);

// Where `components` values, one after another, stand in records that lie `stride` bytes apart.
struct StoredPlace {
  StoredType type = StoredType::kFloat32;
  bool is_swapped = false;  // in the other byte order than this machine's
  std::size_t components = 1;
  std::size_t stride = 0;
};

// Decodes the values of `count` records at `from` to rows at `to`, `to_stride` bytes apart, as
// plyTypeOf(place.type). Nothing need be aligned.
void decodeStored(const StoredPlace& place, const std::byte* from, std::size_t count, std::byte* to,
                  std::size_t to_stride);

// What the values of a channel mean, as far as its name tells, for formats that store no kind:
// three values are a color when the name says so, else a vector.
ChannelKind guessChannelKind(std::string_view name, std::size_t components);

// Whether a reader that guesses kinds gives a channel called `name` the properties that it has in
// `element`: only then is it written as one, else as scalars, so that nothing is renamed.
bool keepsProperties(const RowLayout& element, const RowChannel& channel, std::string_view name);

}  // namespace surfeit
