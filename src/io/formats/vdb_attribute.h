// Attributes of OpenVDB points: the types and codecs of their arrays, decoded into rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "io/channels.h"
#include "io/file.h"
#include "io/ply_format.h"

namespace surfeit {

// How a component is stored.
enum class VdbStorage : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,   // decoded as doubles
  kUint64,  // decoded as doubles
  kHalf,
  kFloat,
  kDouble,
  kFixed8,       // a byte for -0.5 to 0.5
  kFixed16,      // 16 bits for -0.5 to 0.5
  kUnitFixed8,   // a byte for 0 to 1
  kUnitFixed16,  // 16 bits for 0 to 1
  kUnitVector,   // three components in 16 bits
};

// The type of an attribute's values.
struct VdbAttributeType {
  PlyType type = PlyType::kFloat32;  // of a component, decoded
  std::size_t components = 1;
  VdbStorage storage = VdbStorage::kFloat;
  std::size_t value_bytes = 4;  // of all components, stored
};

// Of a value type ("float", "vec3s", ...) and a codec ("null", "trnc", "fxpt16", "uvec", ...).
// Nothing for those that rows do not carry: groups, strings, quaternions by a codec, unknown ones.
std::optional<VdbAttributeType> vdbAttributeType(std::string_view value_type,
                                                 std::string_view codec);

// Decodes `count` components (values, for unit vectors) one after the other from `stored`, each
// row's `per_row` components at `out + row * row_bytes`, in the type of `type`. With is_uniform the
// stored ones are those of the first row, for all.
void decodeVdbAttribute(const VdbAttributeType& type, const std::byte* stored, bool is_uniform,
                        std::size_t rows, std::size_t values_per_row, std::byte* out,
                        std::size_t row_bytes);

// What a channel of that name most likely holds.
ChannelKind vdbChannelKind(std::string_view name, std::size_t components);

}  // namespace surfeit
