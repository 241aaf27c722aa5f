#include "cloud/vdb/vdb_attribute.h"

#include <cmath>
#include <cstring>
#include <limits>

namespace surfeit {
namespace {

struct NamedVdbType {
  std::string_view name;
  std::size_t components;
  StoredType stored;
};

constexpr NamedVdbType kVdbValueTypes[] = {
    {"bool", 1, StoredType::kUint8},     {"int8", 1, StoredType::kInt8},
    {"uint8", 1, StoredType::kUint8},    {"int16", 1, StoredType::kInt16},
    {"uint16", 1, StoredType::kUint16},  {"int32", 1, StoredType::kInt32},
    {"uint32", 1, StoredType::kUint32},  {"int64", 1, StoredType::kInt64},
    {"uint64", 1, StoredType::kUint64},  {"half", 1, StoredType::kFloat16},
    {"float", 1, StoredType::kFloat32},  {"double", 1, StoredType::kFloat64},
    {"vec2i", 2, StoredType::kInt32},    {"vec2s", 2, StoredType::kFloat32},
    {"vec2d", 2, StoredType::kFloat64},  {"vec2h", 2, StoredType::kFloat16},
    {"vec3i", 3, StoredType::kInt32},    {"vec3s", 3, StoredType::kFloat32},
    {"vec3d", 3, StoredType::kFloat64},  {"vec3h", 3, StoredType::kFloat16},
    {"vec4i", 4, StoredType::kInt32},    {"vec4s", 4, StoredType::kFloat32},
    {"vec4d", 4, StoredType::kFloat64},  {"vec4h", 4, StoredType::kFloat16},
    {"quats", 4, StoredType::kFloat32},  {"quatd", 4, StoredType::kFloat64},
    {"mat3s", 9, StoredType::kFloat32},  {"mat3d", 9, StoredType::kFloat64},
    {"mat4s", 16, StoredType::kFloat32}, {"mat4d", 16, StoredType::kFloat64},
};

struct Coded {
  StoredType stored;
  VdbCodec codec;
};

// How a component is stored under a codec.
std::optional<Coded> codedAs(const NamedVdbType& type, std::string_view codec) {
  if (codec == "null") return Coded{type.stored, VdbCodec::kPlain};
  if (codec == "trnc" && type.stored == StoredType::kFloat32) {
    return Coded{StoredType::kFloat16, VdbCodec::kPlain};
  }
  if (codec == "trnc" && type.stored == StoredType::kInt32) {
    return Coded{StoredType::kInt16, VdbCodec::kPlain};
  }
  if (type.stored != StoredType::kFloat32 && type.stored != StoredType::kFloat64) return {};
  if (codec == "uvec" && type.components == 3) {
    return Coded{StoredType::kUint16, VdbCodec::kUnitVector};
  }
  if (codec == "fxpt8") return Coded{StoredType::kUint8, VdbCodec::kFixed};
  if (codec == "fxpt16") return Coded{StoredType::kUint16, VdbCodec::kFixed};
  if (codec == "ufxpt8") return Coded{StoredType::kUint8, VdbCodec::kUnitFixed};
  if (codec == "ufxpt16") return Coded{StoredType::kUint16, VdbCodec::kUnitFixed};
  return {};
}

template <typename Stored, typename Out>
void decodeFixed(const StoredPlace& place, float least, const std::byte* from, std::size_t rows,
                 std::byte* out, std::size_t row_bytes) {
  constexpr float kMost = std::numeric_limits<Stored>::max();
  for (std::size_t row = 0; row < rows; ++row, from += place.stride, out += row_bytes) {
    for (std::size_t i = 0; i < place.components; ++i) {
      Stored value;
      std::memcpy(&value, from + i * sizeof(Stored), sizeof(Stored));
      const Out decoded = static_cast<Out>(value / kMost + least);
      std::memcpy(out + i * sizeof(Out), &decoded, sizeof(Out));
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
void decodeUnitVectors(const StoredPlace& place, const std::byte* from, std::size_t rows,
                       std::byte* out, std::size_t row_bytes) {
  for (std::size_t row = 0; row < rows; ++row, from += place.stride, out += row_bytes) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, from, sizeof(bits));
    double vector[3];
    decodeUnitVector(bits, vector);
    const Out decoded[3] = {static_cast<Out>(vector[0]), static_cast<Out>(vector[1]),
                            static_cast<Out>(vector[2])};
    std::memcpy(out, decoded, sizeof(decoded));
  }
}

// Values that are coded as reals of type Out.
template <typename Out>
void decodeReals(VdbCodec codec, const StoredPlace& place, const std::byte* from, std::size_t rows,
                 std::byte* out, std::size_t row_bytes) {
  if (codec == VdbCodec::kUnitVector) {
    return decodeUnitVectors<Out>(place, from, rows, out, row_bytes);
  }
  const float least = codec == VdbCodec::kFixed ? -0.5f : 0.0f;
  if (place.type == StoredType::kUint8) {
    return decodeFixed<std::uint8_t, Out>(place, least, from, rows, out, row_bytes);
  }
  decodeFixed<std::uint16_t, Out>(place, least, from, rows, out, row_bytes);
}

}  // namespace

std::optional<VdbAttributeType> vdbAttributeType(std::string_view value_type,
                                                 std::string_view codec) {
  for (const NamedVdbType& known : kVdbValueTypes) {
    if (known.name != value_type) continue;
    const std::optional<Coded> coded = codedAs(known, codec);
    if (!coded.has_value()) return {};
    const bool is_unit_vector = coded->codec == VdbCodec::kUnitVector;
    const StoredType decoded = coded->codec == VdbCodec::kPlain ? coded->stored : known.stored;
    return VdbAttributeType{plyTypeOf(decoded), known.components, coded->stored, coded->codec,
                            storedBytes(coded->stored) * (is_unit_vector ? 1 : known.components)};
  }
  return {};
}

void decodeVdbAttribute(const VdbAttributeType& type, const std::byte* stored, bool is_uniform,
                        std::size_t rows, std::size_t values_per_row, std::byte* out,
                        std::size_t row_bytes) {
  StoredPlace place;
  place.type = type.stored;
  place.components = type.components;
  place.stride = is_uniform ? 0 : values_per_row * type.value_bytes;
  for (std::size_t i = 0; i < values_per_row; ++i) {
    if (type.codec == VdbCodec::kPlain) {
      decodeStored(place, stored, rows, out, row_bytes);
    } else if (type.type == ValueType::kFloat64) {
      decodeReals<double>(type.codec, place, stored, rows, out, row_bytes);
    } else {
      decodeReals<float>(type.codec, place, stored, rows, out, row_bytes);
    }
    if (!is_uniform) stored += type.value_bytes;
    out += type.components * valueTypeBytes(type.type);
  }
}

ChannelKind vdbChannelKind(std::string_view name, std::size_t components) {
  if (components == 3) {
    if (name == "P") return ChannelKind::kPoint;
    if (name == "N" || name == "normal") return ChannelKind::kNormal;
    for (const std::string_view color : {"Cd", "heat", "flame"}) {
      if (name.find(color) != std::string_view::npos) return ChannelKind::kColor;
    }
  }
  return guessChannelKind(name, components);
}

}  // namespace surfeit
