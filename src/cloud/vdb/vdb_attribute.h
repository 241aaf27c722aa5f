// Attributes of OpenVDB points: the types and codecs of their arrays, decoded into rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "cloud/parts/stored_values.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/row_layout.h"

namespace surfeit {

// What stored numbers mean.
enum class VdbCodec : std::uint8_t {
  kPlain,       // themselves
  kFixed,       // 0 to the most that they hold: -0.5 to 0.5
  kUnitFixed,   // 0 to the most that they hold: 0 to 1
  kUnitVector,  // one for three components
};

// The type of an attribute's values.
struct VdbAttributeType {
  ValueType type = ValueType::kFloat32;  // of a component, decoded
  std::size_t components = 1;
  StoredType stored = StoredType::kFloat32;
  VdbCodec codec = VdbCodec::kPlain;
  std::size_t value_bytes = 4;  // of all components, stored
};

// Of a value type ("float", "vec3s", ...) and a codec ("null", "trnc", "fxpt16", "uvec", ...).
// Nothing for those that rows do not carry: groups, strings, quaternions by a codec, unknown ones.
std::optional<VdbAttributeType> vdbAttributeType(std::string_view value_type,
                                                 std::string_view codec);

// Decodes the values of `rows` points at `stored`, one after the other, to `out`, `row_bytes`
// apart, in the type of `type`. With is_uniform one value is stored, for all.
void decodeVdbAttribute(const VdbAttributeType& type, const std::byte* stored, bool is_uniform,
                        std::size_t rows, std::size_t values_per_row, std::byte* out,
                        std::size_t row_bytes);

// What a channel of that name most likely holds.
ChannelKind vdbChannelKind(std::string_view name, std::size_t components);

}  // namespace surfeit
