#include "io/formats/vdb_attribute.h"

#include <half.h>

#include <cmath>
#include <cstring>

namespace surfeit {
namespace {

struct ValueType {
  std::string_view name;
  std::size_t components;
  VdbStorage storage;
};

constexpr ValueType kValueTypes[] = {
    {"bool", 1, VdbStorage::kUint8},    {"int8", 1, VdbStorage::kInt8},
    {"uint8", 1, VdbStorage::kUint8},   {"int16", 1, VdbStorage::kInt16},
    {"uint16", 1, VdbStorage::kUint16}, {"int32", 1, VdbStorage::kInt32},
    {"uint32", 1, VdbStorage::kUint32}, {"int64", 1, VdbStorage::kInt64},
    {"uint64", 1, VdbStorage::kUint64}, {"half", 1, VdbStorage::kHalf},
    {"float", 1, VdbStorage::kFloat},   {"double", 1, VdbStorage::kDouble},
    {"vec2i", 2, VdbStorage::kInt32},   {"vec2s", 2, VdbStorage::kFloat},
    {"vec2d", 2, VdbStorage::kDouble},  {"vec2h", 2, VdbStorage::kHalf},
    {"vec3i", 3, VdbStorage::kInt32},   {"vec3s", 3, VdbStorage::kFloat},
    {"vec3d", 3, VdbStorage::kDouble},  {"vec3h", 3, VdbStorage::kHalf},
    {"vec4i", 4, VdbStorage::kInt32},   {"vec4s", 4, VdbStorage::kFloat},
    {"vec4d", 4, VdbStorage::kDouble},  {"vec4h", 4, VdbStorage::kHalf},
    {"quats", 4, VdbStorage::kFloat},   {"quatd", 4, VdbStorage::kDouble},
    {"mat3s", 9, VdbStorage::kFloat},   {"mat3d", 9, VdbStorage::kDouble},
    {"mat4s", 16, VdbStorage::kFloat},  {"mat4d", 16, VdbStorage::kDouble},
};

std::size_t storedBytes(VdbStorage storage) {
  switch (storage) {
    case VdbStorage::kInt8:
    case VdbStorage::kUint8:
    case VdbStorage::kFixed8:
    case VdbStorage::kUnitFixed8:
      return 1;
    case VdbStorage::kInt16:
    case VdbStorage::kUint16:
    case VdbStorage::kHalf:
    case VdbStorage::kFixed16:
    case VdbStorage::kUnitFixed16:
    case VdbStorage::kUnitVector:
      return 2;
    case VdbStorage::kInt64:
    case VdbStorage::kUint64:
    case VdbStorage::kDouble:
      return 8;
    default:
      return 4;
  }
}

// The storage of a component under a codec.
std::optional<VdbStorage> encodedStorage(const ValueType& type, std::string_view codec) {
  const bool is_real = type.storage == VdbStorage::kFloat || type.storage == VdbStorage::kDouble;
  if (codec == "null") return type.storage;
  if (codec == "trnc" && type.storage == VdbStorage::kFloat) return VdbStorage::kHalf;
  if (codec == "trnc" && type.storage == VdbStorage::kInt32) return VdbStorage::kInt16;
  if (codec == "uvec" && is_real && type.components == 3) return VdbStorage::kUnitVector;
  if (!is_real) return {};
  if (codec == "fxpt8") return VdbStorage::kFixed8;
  if (codec == "fxpt16") return VdbStorage::kFixed16;
  if (codec == "ufxpt8") return VdbStorage::kUnitFixed8;
  if (codec == "ufxpt16") return VdbStorage::kUnitFixed16;
  return {};
}

PlyType decodedType(VdbStorage value_storage) {
  switch (value_storage) {
    case VdbStorage::kInt8:
      return PlyType::kInt8;
    case VdbStorage::kUint8:
      return PlyType::kUint8;
    case VdbStorage::kInt16:
      return PlyType::kInt16;
    case VdbStorage::kUint16:
      return PlyType::kUint16;
    case VdbStorage::kInt32:
      return PlyType::kInt32;
    case VdbStorage::kUint32:
      return PlyType::kUint32;
    case VdbStorage::kInt64:
    case VdbStorage::kUint64:
    case VdbStorage::kDouble:
      return PlyType::kFloat64;
    default:
      return PlyType::kFloat32;
  }
}

// Decodes every component of every row by `decode`, from Stored to Out.
template <typename Stored, typename Out, typename Decode>
void decodeComponents(const std::byte* stored, bool is_uniform, std::size_t uniform_values,
                      std::size_t rows, std::size_t per_row, std::byte* out, std::size_t row_bytes,
                      Decode decode) {
  for (std::size_t row = 0; row < rows; ++row) {
    std::byte* row_out = out + row * row_bytes;
    for (std::size_t i = 0; i < per_row; ++i) {
      const std::size_t index = is_uniform ? i % uniform_values : row * per_row + i;
      Stored value;
      std::memcpy(&value, stored + index * sizeof(Stored), sizeof(Stored));
      const Out decoded = static_cast<Out>(decode(value));
      std::memcpy(row_out + i * sizeof(Out), &decoded, sizeof(Out));
    }
  }
}

// OpenVDB's 16 bits for a unit vector: signs of x, y, z; then x in 6 and y in 7 bits on the plane
// |x| + |y| + |z| = 126, folded where x + y is more than that.
void decodeUnitVector(std::uint16_t bits, double (&vector)[3]) {
  int x = (bits >> 7) & 0x3F, y = bits & 0x7F;
  if (x + y >= 127) {
    x = 127 - x;
    y = 127 - y;
  }
  const int z = 126 - x - y;
  const double length = std::sqrt(double(x) * x + double(y) * y + double(z) * z);
  vector[0] = ((bits & 0x8000) != 0 ? -x : x) / length;
  vector[1] = ((bits & 0x4000) != 0 ? -y : y) / length;
  vector[2] = ((bits & 0x2000) != 0 ? -z : z) / length;
}

template <typename Out>
void decodeUnitVectors(const std::byte* stored, bool is_uniform, std::size_t rows,
                       std::size_t values_per_row, std::byte* out, std::size_t row_bytes) {
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t i = 0; i < values_per_row; ++i) {
      std::uint16_t bits = 0;
      std::memcpy(&bits, stored + 2 * (is_uniform ? 0 : row * values_per_row + i), 2);
      double vector[3];
      decodeUnitVector(bits, vector);
      const Out decoded[3] = {static_cast<Out>(vector[0]), static_cast<Out>(vector[1]),
                              static_cast<Out>(vector[2])};
      std::memcpy(out + row * row_bytes + i * sizeof(decoded), decoded, sizeof(decoded));
    }
  }
}

}  // namespace

std::optional<VdbAttributeType> vdbAttributeType(std::string_view value_type,
                                                 std::string_view codec) {
  for (const ValueType& known : kValueTypes) {
    if (known.name != value_type) continue;
    const std::optional<VdbStorage> storage = encodedStorage(known, codec);
    if (!storage.has_value()) return {};
    const bool is_unit_vector = *storage == VdbStorage::kUnitVector;
    return VdbAttributeType{decodedType(known.storage), known.components, *storage,
                            storedBytes(*storage) * (is_unit_vector ? 1 : known.components)};
  }
  return {};
}

void decodeVdbAttribute(const VdbAttributeType& type, const std::byte* stored, bool is_uniform,
                        std::size_t rows, std::size_t values_per_row, std::byte* out,
                        std::size_t row_bytes) {
  const auto decode = [&]<typename Stored, typename Out>(Stored, Out, auto value) {
    decodeComponents<Stored, Out>(stored, is_uniform, type.components, rows,
                                  values_per_row * type.components, out, row_bytes, value);
  };
  const auto same = [](auto value) { return value; };
  const auto decodeReal = [&]<typename Stored>(Stored, auto value) {
    if (type.type == PlyType::kFloat64) return decode(Stored(), double(), value);
    decode(Stored(), float(), value);
  };
  switch (type.storage) {
    case VdbStorage::kInt8:
      return decode(std::int8_t(), std::int8_t(), same);
    case VdbStorage::kUint8:
      return decode(std::uint8_t(), std::uint8_t(), same);
    case VdbStorage::kInt16:
      if (type.type == PlyType::kInt32) return decode(std::int16_t(), std::int32_t(), same);
      return decode(std::int16_t(), std::int16_t(), same);
    case VdbStorage::kUint16:
      return decode(std::uint16_t(), std::uint16_t(), same);
    case VdbStorage::kInt32:
      return decode(std::int32_t(), std::int32_t(), same);
    case VdbStorage::kUint32:
      return decode(std::uint32_t(), std::uint32_t(), same);
    case VdbStorage::kInt64:
      return decode(std::int64_t(), double(), same);
    case VdbStorage::kUint64:
      return decode(std::uint64_t(), double(), same);
    case VdbStorage::kHalf:
      return decodeReal(std::uint16_t(), [](std::uint16_t v) { return imath_half_to_float(v); });
    case VdbStorage::kFloat:
      return decodeReal(float(), same);
    case VdbStorage::kDouble:
      return decode(double(), double(), same);
    case VdbStorage::kFixed8:
      return decodeReal(std::uint8_t(), [](std::uint8_t v) { return v / 255.0f - 0.5f; });
    case VdbStorage::kFixed16:
      return decodeReal(std::uint16_t(), [](std::uint16_t v) { return v / 65535.0f - 0.5f; });
    case VdbStorage::kUnitFixed8:
      return decodeReal(std::uint8_t(), [](std::uint8_t v) { return v / 255.0f; });
    case VdbStorage::kUnitFixed16:
      return decodeReal(std::uint16_t(), [](std::uint16_t v) { return v / 65535.0f; });
    case VdbStorage::kUnitVector:
      if (type.type == PlyType::kFloat64) {
        return decodeUnitVectors<double>(stored, is_uniform, rows, values_per_row, out, row_bytes);
      }
      return decodeUnitVectors<float>(stored, is_uniform, rows, values_per_row, out, row_bytes);
  }
}

ChannelKind vdbChannelKind(std::string_view name, std::size_t components) {
  if (components == 16) return ChannelKind::kMatrix;
  if (components != 3) return ChannelKind::kFloat;
  if (name == "P") return ChannelKind::kPoint;
  if (name == "N" || name == "normal") return ChannelKind::kNormal;
  constexpr std::string_view kColors[] = {"Cd",       "color", "radiosity", "irradiance",
                                          "emission", "heat",  "albedo",    "flame"};
  for (const std::string_view color : kColors) {
    if (name.find(color) != std::string_view::npos) return ChannelKind::kColor;
  }
  return ChannelKind::kVector;
}

}  // namespace surfeit
