// The octahedral map: Zina H. Cigolle et al. A Survey of Efficient Representations for Independent
// Unit Vectors. JCGT 3(2), 2014.
#include "octree/column_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/assert.h"
#include "core/bounds.h"

namespace surfeit {
namespace {

// First byte of a column that has several forms.
enum ColumnForm : std::uint8_t {
  kFormZero = 0,   // all values zero, nothing follows
  kFormFloat = 4,  // floats
  // 2 and 3: quantized to that many bytes
};

constexpr float kMaxUint16 = 65535;
// Powers of two that 16 bits tell apart by 3e-4; wider ranges are stored as floats.
constexpr float kMaxLogRange = 64;

// The low `width` bytes of each value, plane by plane.
template <typename T>
void putPlanes(ByteWriter& writer, std::span<const T> values, int width) {
  std::vector<std::byte> plane(values.size());
  for (int byte = 0; byte < width; ++byte) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      plane[i] = static_cast<std::byte>(values[i] >> (8 * byte) & 0xff);
    }
    writer.putBytes(plane);
  }
}

template <typename T>
bool getPlanes(ByteReader& reader, std::span<T> values, int width) {
  std::fill(values.begin(), values.end(), T{0});
  for (int byte = 0; byte < width; ++byte) {
    const std::span<const std::byte> plane = reader.take(values.size());
    if (!reader.ok()) return false;
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<T>(values[i] | static_cast<T>(plane[i]) << (8 * byte));
    }
  }
  return true;
}

// Scratch for one column, per thread so that decoding a page allocates nothing.
template <typename T>
std::span<T> scratch(std::size_t count) {
  thread_local std::vector<T> values;
  if (values.size() < count) values.resize(count);
  return std::span<T>(values).first(count);
}

float component(std::span<const glm::vec3> values, std::size_t i, int axis) {
  return values[i][axis];
}

void putVectorFloats(ByteWriter& writer, std::span<const glm::vec3> values) {
  const std::span<float> axis_values = scratch<float>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < values.size(); ++i) axis_values[i] = component(values, i, axis);
    putFloats(writer, axis_values);
  }
}

bool getVectorFloats(ByteReader& reader, std::span<glm::vec3> values) {
  const std::span<float> axis_values = scratch<float>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    if (!getFloats(reader, axis_values)) return false;
    for (std::size_t i = 0; i < values.size(); ++i) values[i][axis] = axis_values[i];
  }
  return true;
}

bool isNonNegative(const glm::vec3& v) { return v.x >= 0 && v.y >= 0 && v.z >= 0; }

bool isUnitOrZero(const glm::vec3& v) {
  const float length_sq = glm::dot(v, v);
  return length_sq == 0 || std::abs(length_sq - 1) < 1e-3f;
}

// Bytes per axis that keep the error of a box of this extent within max_error.
std::uint8_t positionForm(const Bounds3& box, float max_error, bool full_precision) {
  if (full_precision) return kFormFloat;
  const glm::vec3 extent = box.extent();
  const float largest = std::max({extent.x, extent.y, extent.z});
  if (!std::isfinite(largest)) return kFormFloat;
  // Half a step per axis, at worst in all three
  constexpr float kDiagonal = 0.8661f;
  if (largest / kMaxUint16 * kDiagonal <= max_error) return 2;
  if (largest / float(0xffffff) * kDiagonal <= max_error) return 3;
  return kFormFloat;
}

Bounds3 boxOf(std::span<const glm::vec3> values) {
  Bounds3 box;
  for (const glm::vec3& value : values) box.add(value);
  return box;
}

// float -> IEEE half, rounded to nearest even; 0 <= value < 65520.
std::uint16_t halfFromFloat(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  if (value < 0x1p-14f) {  // subnormal: multiples of 2^-24
    return static_cast<std::uint16_t>(std::nearbyintf(value * 0x1p24f));
  }
  const std::uint32_t rounded = bits + 0xfff + (bits >> 13 & 1);
  return static_cast<std::uint16_t>((rounded >> 13) - (112u << 10));
}

// Finite, non-negative halves only; others become NaN.
float floatFromHalf(std::uint16_t half) {
  if (half >= 0x7c00) return std::numeric_limits<float>::quiet_NaN();
  if (half < 0x0400) return float(half) * 0x1p-24f;
  return std::bit_cast<float>((std::uint32_t{half} + (112u << 10)) << 13);
}

// Octahedral map to [-1, 1]^2 and back.
void octahedronFromUnit(const glm::vec3& n, float& u, float& v) {
  const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  if (!(sum > 0)) {
    u = v = 0;
    return;
  }
  u = n.x / sum;
  v = n.y / sum;
  if (n.z < 0) {
    const float folded = (1 - std::abs(v)) * (u < 0 ? -1.f : 1.f);
    v = (1 - std::abs(u)) * (v < 0 ? -1.f : 1.f);
    u = folded;
  }
}

glm::vec3 unitFromOctahedron(float u, float v) {
  glm::vec3 n(u, v, 1 - std::abs(u) - std::abs(v));
  const float fold = std::max(-n.z, 0.f);
  n.x += n.x < 0 ? fold : -fold;
  n.y += n.y < 0 ? fold : -fold;
  return n / std::sqrt(glm::dot(n, n));
}

std::uint16_t unormFromSigned(float value) {
  return static_cast<std::uint16_t>(std::lround((value * 0.5f + 0.5f) * kMaxUint16));
}

}  // namespace

void putPositions(ByteWriter& writer, std::span<const glm::vec3> values, float max_error,
                  bool full_precision) {
  const Bounds3 box = boxOf(values);
  const std::uint8_t form = positionForm(box, max_error, full_precision);
  writer.put(form);
  if (form == kFormFloat) return putVectorFloats(writer, values);
  const double steps = double((1u << (8 * form)) - 1);
  const std::span<std::uint32_t> codes = scratch<std::uint32_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    const float min = box.min[axis];
    const float extent = box.max[axis] - min;
    writer.put(min);
    writer.put(extent);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double at = extent > 0 ? (double(values[i][axis]) - double(min)) / double(extent) : 0;
      codes[i] = static_cast<std::uint32_t>(std::lround(std::clamp(at, 0.0, 1.0) * steps));
    }
    putPlanes<std::uint32_t>(writer, codes, form);
  }
}

bool getPositions(ByteReader& reader, std::span<glm::vec3> values) {
  const std::uint8_t form = reader.get<std::uint8_t>();
  if (form == kFormFloat) return getVectorFloats(reader, values);
  if (form != 2 && form != 3) return false;
  const double steps = double((1u << (8 * form)) - 1);
  const std::span<std::uint32_t> codes = scratch<std::uint32_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    const float min = reader.get<float>();
    const float extent = reader.get<float>();
    if (!std::isfinite(min) || !std::isfinite(extent) || extent < 0 || !std::isfinite(min + extent))
      return false;
    if (!getPlanes<std::uint32_t>(reader, codes, form)) return false;
    const double step = double(extent) / steps;
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i][axis] = float(double(min) + double(codes[i]) * step);
    }
  }
  return true;
}

float positionError(std::span<const glm::vec3> values, float max_error, bool full_precision) {
  return positionForm(boxOf(values), max_error, full_precision) == kFormFloat ? 0 : max_error;
}

void putPositive(ByteWriter& writer, std::span<const float> values, Rounding rounding,
                 bool full_precision) {
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  const float range = values.empty() ? 0 : std::max(0.f, std::log2(*max) - std::log2(*min));
  if (full_precision || range > kMaxLogRange) {
    writer.put(std::uint8_t{kFormFloat});
    return putFloats(writer, values);
  }
  writer.put(std::uint8_t{2});
  writer.put(values.empty() ? 1.f : *min);
  writer.put(range);
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float at = range > 0 ? std::log2(values[i] / *min) / range * kMaxUint16 : 0;
    const float code =
        rounding == Rounding::kUp ? std::ceil(at) + (at > 0 ? 1 : 0) : std::nearbyintf(at);
    codes[i] = static_cast<std::uint16_t>(std::clamp(code, 0.f, kMaxUint16));
  }
  putPlanes<std::uint16_t>(writer, codes, 2);
}

bool getPositive(ByteReader& reader, std::span<float> values) {
  const std::uint8_t form = reader.get<std::uint8_t>();
  if (form == kFormFloat) {
    if (!getFloats(reader, values)) return false;
    return std::all_of(values.begin(), values.end(), [](float v) { return v > 0; });
  }
  if (form != 2) return false;
  const float min = reader.get<float>();
  const float range = reader.get<float>();
  if (!(min > 0) || !(range >= 0) || !std::isfinite(min * std::exp2(range))) return false;
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  if (!getPlanes<std::uint16_t>(reader, codes, 2)) return false;
  if (range == 0) {
    std::fill(values.begin(), values.end(), min);
    return true;
  }
  const float step = range / kMaxUint16;
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = min * std::exp2(float(codes[i]) * step);
  return true;
}

void putNormals(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision) {
  if (full_precision) {
    writer.put(std::uint8_t{kFormFloat});
    return putVectorFloats(writer, values);
  }
  writer.put(std::uint8_t{2});
  const std::span<std::uint32_t> codes = scratch<std::uint32_t>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    float u, v;
    octahedronFromUnit(values[i], u, v);
    codes[i] = std::uint32_t{unormFromSigned(u)} | std::uint32_t{unormFromSigned(v)} << 16;
  }
  putPlanes<std::uint32_t>(writer, codes, 4);
}

bool getNormals(ByteReader& reader, std::span<glm::vec3> values) {
  const std::uint8_t form = reader.get<std::uint8_t>();
  if (form == kFormFloat) {
    return getVectorFloats(reader, values) &&
           std::all_of(values.begin(), values.end(), isUnitOrZero);
  }
  if (form != 2) return false;
  const std::span<std::uint32_t> codes = scratch<std::uint32_t>(values.size());
  if (!getPlanes<std::uint32_t>(reader, codes, 4)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = unitFromOctahedron(float(codes[i] & 0xffff) / kMaxUint16 * 2 - 1,
                                   float(codes[i] >> 16) / kMaxUint16 * 2 - 1);
  }
  return true;
}

void putColors(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision) {
  float largest = 0;
  for (const glm::vec3& value : values) largest = std::max({largest, value.x, value.y, value.z});
  if (largest == 0) return writer.put(std::uint8_t{kFormZero});
  if (full_precision) {
    writer.put(std::uint8_t{kFormFloat});
    return putVectorFloats(writer, values);
  }
  // The power of two brings the largest value to [2^14, 2^15): the full range of a half
  const int exponent = std::clamp(std::ilogb(largest) - 14, -126, 126);
  writer.put(std::uint8_t{2});
  writer.put(static_cast<std::int8_t>(exponent));
  // Rounding the largest floats up would make them infinite: 32752 is the last half below 2^15
  const float limit = exponent == 113 ? 32752.f : 65504.f;
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      codes[i] = halfFromFloat(std::min(std::ldexp(values[i][axis], -exponent), limit));
    }
    putPlanes<std::uint16_t>(writer, codes, 2);
  }
}

bool getColors(ByteReader& reader, std::span<glm::vec3> values) {
  const std::uint8_t form = reader.get<std::uint8_t>();
  if (form == kFormZero) {
    std::fill(values.begin(), values.end(), glm::vec3(0));
    return reader.ok();
  }
  if (form == kFormFloat) {
    return getVectorFloats(reader, values) &&
           std::all_of(values.begin(), values.end(), isNonNegative);
  }
  if (form != 2) return false;
  const int exponent = reader.get<std::int8_t>();
  const float scale = std::ldexp(1.f, std::clamp(exponent, -126, 126));
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    if (!getPlanes<std::uint16_t>(reader, codes, 2)) return false;
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i][axis] = floatFromHalf(codes[i]) * scale;
      if (!std::isfinite(values[i][axis])) return false;
    }
  }
  return true;
}

void putReflectances(ByteWriter& writer, std::span<const glm::vec3> values, bool full_precision) {
  if (full_precision) {
    writer.put(std::uint8_t{kFormFloat});
    return putVectorFloats(writer, values);
  }
  writer.put(std::uint8_t{2});
  const std::span<std::uint8_t> codes = scratch<std::uint8_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const float root = std::sqrt(std::clamp(values[i][axis], 0.f, 1.f));
      codes[i] = static_cast<std::uint8_t>(std::lround(root * 255));
    }
    putBytes8(writer, codes);
  }
}

bool getReflectances(ByteReader& reader, std::span<glm::vec3> values) {
  const std::uint8_t form = reader.get<std::uint8_t>();
  if (form == kFormFloat) {
    return getVectorFloats(reader, values) &&
           std::all_of(values.begin(), values.end(), isNonNegative);
  }
  if (form != 2) return false;
  const std::span<std::uint8_t> codes = scratch<std::uint8_t>(values.size());
  for (int axis = 0; axis < 3; ++axis) {
    if (!getBytes8(reader, codes)) return false;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const float root = float(codes[i]) / 255;
      values[i][axis] = root * root;
    }
  }
  return true;
}

void putSigned(ByteWriter& writer, std::span<const float> values, float limit) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float code = std::clamp(std::nearbyintf(values[i] / limit * 32767), -32767.f, 32767.f);
    codes[i] = static_cast<std::uint16_t>(static_cast<std::int16_t>(code));
  }
  putPlanes<std::uint16_t>(writer, codes, 2);
}

bool getSigned(ByteReader& reader, std::span<float> values, float limit) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t>(values.size());
  if (!getPlanes<std::uint16_t>(reader, codes, 2)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = float(static_cast<std::int16_t>(codes[i])) * (limit / 32767);
  }
  return true;
}

void putCounts(ByteWriter& writer, std::span<const std::uint64_t> values) {
  const std::uint64_t largest =
      values.empty() ? 0 : *std::max_element(values.begin(), values.end());
  const int width = largest < 0x100 ? 1 : largest < 0x10000 ? 2 : largest < 0x100000000 ? 4 : 8;
  writer.put(static_cast<std::uint8_t>(width));
  putPlanes<std::uint64_t>(writer, values, width);
}

bool getCounts(ByteReader& reader, std::span<std::uint64_t> values) {
  const int width = reader.get<std::uint8_t>();
  if (width != 1 && width != 2 && width != 4 && width != 8) return false;
  return getPlanes<std::uint64_t>(reader, values, width);
}

void putBytes8(ByteWriter& writer, std::span<const std::uint8_t> values) {
  writer.putBytes(std::as_bytes(values));
}

bool getBytes8(ByteReader& reader, std::span<std::uint8_t> values) {
  return getPlanes<std::uint8_t>(reader, values, 1);
}

void putFloats(ByteWriter& writer, std::span<const float> values) {
  std::vector<std::uint32_t> bits(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) bits[i] = std::bit_cast<std::uint32_t>(values[i]);
  putPlanes<std::uint32_t>(writer, bits, 4);
}

bool getFloats(ByteReader& reader, std::span<float> values) {
  const std::span<std::uint32_t> bits = scratch<std::uint32_t>(values.size());
  if (!getPlanes<std::uint32_t>(reader, bits, 4)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = std::bit_cast<float>(bits[i]);
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

}  // namespace surfeit
