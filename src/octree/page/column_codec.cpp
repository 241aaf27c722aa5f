// The octahedral map: Zina H. Cigolle et al. A Survey of Efficient Representations for Independent
// Unit Vectors. JCGT 3(2), 2014.
#include "octree/page/column_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/surfel_limits.h"
#include "octree/node/moment_codes.h"

namespace surfeit {
namespace {

// First byte of a column that has several forms.
enum ColumnForm : std::uint8_t {
  kFormZero = 0,   // all values zero, nothing follows
  kFormFloat = 4,  // floats
  // 2 and 3: quantized to that many bytes
};

constexpr std::uint32_t kInfinityBits = 0x7f800000;

bool allFinite(std::span<const float> values) {
  std::int32_t largest = 0;
  for (const float value : values) {
    largest = std::max(largest,
                       static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(value) & 0x7fffffff));
  }
  return largest < static_cast<std::int32_t>(kInfinityBits);
}

bool allNonNegative(const Axes& values) {
  return std::all_of(values.begin(), values.end(), [](std::span<const float> axis) {
    return std::all_of(axis.begin(), axis.end(), [](float value) { return value >= 0; });
  });
}

void putAxesAsFloats(PayloadWriter& writer, const Axes& values) {
  writer.put(std::uint8_t{kFormFloat});
  for (const std::span<const float> axis : values) putFloats(writer, axis);
}

bool getAxesAsFloats(PayloadReader& reader, const MutableAxes& values) {
  return std::all_of(values.begin(), values.end(),
                     [&](std::span<float> axis) { return getFloats(reader, axis); });
}

// Least and greatest of the values; 0 and 0 of none. Sixteen at a time, because a chain of single
// comparisons waits for each.
struct Range {
  float least = 0, greatest = 0;
};

Range rangeOf(std::span<const float> values) {
  constexpr std::size_t kLanes = 16;
  if (values.empty()) return {};
  std::array<float, kLanes> least, greatest;
  least.fill(values.front());
  greatest.fill(values.front());
  const float* const from = values.data();
  std::size_t i = 0;
  for (; i + kLanes <= values.size(); i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float value = from[i + lane];
      least[lane] = value < least[lane] ? value : least[lane];
      greatest[lane] = value > greatest[lane] ? value : greatest[lane];
    }
  }
  for (; i < values.size(); ++i) {
    least[0] = std::min(least[0], from[i]);
    greatest[0] = std::max(greatest[0], from[i]);
  }
  return {*std::min_element(least.begin(), least.end()),
          *std::max_element(greatest.begin(), greatest.end())};
}

// How positions are stored: multiples of `step` above `min`.
struct PositionGrid {
  std::uint8_t form = kFormFloat;
  float step = 1;
  std::array<float, 3> min{};
};

PositionGrid positionGrid(const Axes& values, float max_error, bool full_precision) {
  PositionGrid grid;
  double extent = 0;
  float greatest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Range range = rangeOf(values[axis]);
    grid.min[axis] = range.least;
    extent = std::max(extent, double(range.greatest) - double(range.least));
    greatest = std::max(greatest, range.greatest);
  }
  if (full_precision) return grid;
  // Half a step per axis is the error, at worst in all three: sqrt(3) / 2
  constexpr float kHalfDiagonal = 0.8661f;
  const float step = std::min(max_error / kHalfDiagonal, std::numeric_limits<float>::max());
  // The last step may lie beyond the greatest position, but not beyond the floats
  if (!(step >= std::numeric_limits<float>::min()) || !std::isfinite(greatest + step)) return grid;
  grid.step = step;
  const double steps = std::ceil(extent / double(step));
  grid.form = steps <= 0xffff ? 2 : steps <= 0xffffff ? 3 : kFormFloat;
  return grid;
}

template <int Width, typename T>
void putGridAxis(PayloadWriter& writer, std::span<const float> values, float min, float step) {
  const std::span<T> codes = scratch<T, Use::kCodes>(values.size());
  const double inverse = 1 / double(step);
  const float* const from = values.data();
  T* const to = codes.data();
  for (std::size_t i = 0; i < codes.size(); ++i) {
    to[i] =
        static_cast<T>(static_cast<std::int32_t>((double(from[i]) - double(min)) * inverse + 0.5));
  }
  putDifferences<Width, T>(writer, codes);
}

template <int Width, typename T>
bool getGridAxis(PayloadReader& reader, std::span<float> values, float min, float step) {
  const std::span<T> codes = scratch<T, Use::kCodes>(values.size());
  if (!getDifferences<Width>(reader, codes)) return false;
  const T* const from = codes.data();
  float* const to = values.data();
  for (std::size_t i = 0; i < codes.size(); ++i) {
    to[i] = float(double(min) + double(static_cast<std::int32_t>(from[i])) * double(step));
  }
  return allFinite(values);
}

// float -> IEEE half, rounded to nearest even; 0 <= value < 65520.
std::uint32_t halfFromFloat(float value) {
  // Adding 0.5 leaves multiples of 2^-24, which are what halves below 2^-14 are
  const std::uint32_t small =
      std::bit_cast<std::uint32_t>(value + 0.5f) - std::bit_cast<std::uint32_t>(0.5f);
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t large = ((bits + 0xfff + (bits >> 13 & 1)) >> 13) - (112u << 10);
  return bits < std::bit_cast<std::uint32_t>(0x1p-14f) ? small : large;
}

constexpr std::uint16_t kHalfInfinity = 0x7c00;

// 2^exponent, a normal float.
float powerOfTwo(int exponent) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(exponent + 127) << 23);
}

int clampedExponent(int exponent) { return std::clamp(exponent, -126, 126); }

// The steps of an octahedral coordinate from -1 to 1: even, so that 0 is one of them and normals
// along the axes are exact.
constexpr float kOctahedronSteps = 65534;

float absolute(float value) {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(value) & 0x7fffffff);
}

float withSignOf(float magnitude, float sign) {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(magnitude) |
                              (std::bit_cast<std::uint32_t>(sign) & 0x80000000));
}

std::uint16_t octahedronCode(float coordinate) {
  return static_cast<std::uint16_t>(
      static_cast<std::int32_t>((coordinate * 0.5f + 0.5f) * kOctahedronSteps + 0.5f));
}

}  // namespace

void putPositions(PayloadWriter& writer, const Axes& values, float max_error, bool full_precision) {
  const PositionGrid grid = positionGrid(values, max_error, full_precision);
  if (grid.form == kFormFloat) return putAxesAsFloats(writer, values);
  writer.put(grid.form);
  writer.put(grid.step);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    writer.put(grid.min[axis]);
    if (grid.form == 2) {
      putGridAxis<2, std::uint16_t>(writer, values[axis], grid.min[axis], grid.step);
    } else {
      putGridAxis<3, std::uint32_t>(writer, values[axis], grid.min[axis], grid.step);
    }
  }
}

bool getPositions(PayloadReader& reader, const MutableAxes& values) {
  const std::uint8_t form = reader.packed.get<std::uint8_t>();
  if (form == kFormFloat) return getAxesAsFloats(reader, values);
  const float step = reader.packed.get<float>();
  // An infinite step or least coordinate makes positions that are refused as such
  if ((form != 2 && form != 3) || !(step > 0)) return false;
  for (const std::span<float> axis : values) {
    const float min = reader.packed.get<float>();
    if (!(form == 2 ? getGridAxis<2, std::uint16_t>(reader, axis, min, step)
                    : getGridAxis<3, std::uint32_t>(reader, axis, min, step))) {
      return false;
    }
  }
  return true;
}

void putPositive(PayloadWriter& writer, std::span<const float> values, Rounding rounding,
                 bool full_precision) {
  const auto [least, greatest] = rangeOf(values);
  const std::uint32_t min = std::bit_cast<std::uint32_t>(least);
  const std::uint32_t range = std::bit_cast<std::uint32_t>(greatest) - min;
  const std::uint32_t round_up = rounding == Rounding::kUp ? 1 : 0;
  // The least shift that leaves codes of 16 bits, rounded ones too
  int shift = std::max(0, static_cast<int>(std::bit_width(range)) - 16);
  const auto rounder = [&] { return round_up ? (1u << shift) - 1 : (1u << shift) >> 1; };
  if ((range + rounder()) >> shift > 0xffff) ++shift;
  // 13 is a range of 64 powers of two, with an error of 0.05 %
  if (full_precision || shift > 13 || min < std::bit_cast<std::uint32_t>(0x1p-126f)) {
    writer.put(std::uint8_t{kFormFloat});
    return putFloats(writer, values);
  }
  writer.put(std::uint8_t{2});
  writer.put(std::bit_cast<float>(min));
  writer.put(static_cast<std::uint8_t>(shift));
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  const std::uint32_t offset = rounder() - min;
  const float* const from = values.data();
  std::uint16_t* const to = codes.data();
  for (std::size_t i = 0; i < codes.size(); ++i) {
    to[i] = static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(from[i]) + offset) >> shift);
  }
  putDifferences<2, std::uint16_t>(writer, codes);
}

bool getPositive(PayloadReader& reader, std::span<float> values) {
  const std::uint8_t form = reader.packed.get<std::uint8_t>();
  if (form == kFormFloat) {
    if (!getFloats(reader, values)) return false;
    return std::all_of(values.begin(), values.end(), [](float v) { return v > 0; });
  }
  const float min = reader.packed.get<float>();
  const int shift = reader.packed.get<std::uint8_t>();
  if (form != 2 || !std::isfinite(min) || !(min > 0) || shift > 13) return false;
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  if (!getDifferences<2>(reader, codes)) return false;
  // A value rounded up may not become infinite
  constexpr auto kMaxBits = static_cast<std::int32_t>(kInfinityBits - 1);
  const auto min_bits = std::bit_cast<std::int32_t>(min);
  const std::int32_t max_above = kMaxBits - min_bits;
  const std::uint16_t* const from = codes.data();
  float* const to = values.data();
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const std::int32_t above = std::int32_t{from[i]} << shift;
    to[i] = std::bit_cast<float>(min_bits + (above < max_above ? above : max_above));
  }
  return true;
}

void putNormals(PayloadWriter& writer, const Axes& values, bool full_precision) {
  if (full_precision) return putAxesAsFloats(writer, values);
  writer.put(std::uint8_t{2});
  const std::size_t count = values[0].size();
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(2 * count);
  const float *const x = values[0].data(), *const y = values[1].data(), *const z = values[2].data();
  std::uint16_t *const to_u = codes.data(), *const to_v = to_u + count;
  for (std::size_t i = 0; i < count; ++i) {
    // A zero vector gives 0, 0
    const float sum = absolute(x[i]) + absolute(y[i]) + absolute(z[i]);
    const float inverse = 1 / (sum + 0x1p-126f);
    const float u = x[i] * inverse, v = y[i] * inverse;
    // The lower half is folded over the corners
    const float folded_u = withSignOf(1 - absolute(v), u);
    const float folded_v = withSignOf(1 - absolute(u), v);
    to_u[i] = octahedronCode(z[i] < 0 ? folded_u : u);
    to_v[i] = octahedronCode(z[i] < 0 ? folded_v : v);
  }
  putDifferences<2, std::uint16_t>(writer, codes.first(count));
  putDifferences<2, std::uint16_t>(writer, codes.subspan(count));
}

bool getNormals(PayloadReader& reader, const MutableAxes& values) {
  const std::uint8_t form = reader.packed.get<std::uint8_t>();
  float *const x = values[0].data(), *const y = values[1].data(), *const z = values[2].data();
  const std::size_t count = values[0].size();
  if (form == kFormFloat) {
    if (!getAxesAsFloats(reader, values)) return false;
    for (std::size_t i = 0; i < count; ++i) {
      const float length_sq = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
      if (!(length_sq == 0 || std::abs(length_sq - 1) < 1e-3f)) return false;
    }
    return true;
  }
  if (form != 2) return false;
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(2 * count);
  if (!getDifferences<2>(reader, codes.first(count))) return false;
  if (!getDifferences<2>(reader, codes.subspan(count))) return false;
  const std::uint16_t *const from_u = codes.data(), *const from_v = from_u + count;
  for (std::size_t i = 0; i < count; ++i) {
    const float u = float(std::int32_t{from_u[i]} - 32767) * (2 / kOctahedronSteps);
    const float v = float(std::int32_t{from_v[i]} - 32767) * (2 / kOctahedronSteps);
    const float w = 1 - absolute(u) - absolute(v);
    const float fold = w < 0 ? w : 0;
    const float nx = u + withSignOf(1, u) * fold, ny = v + withSignOf(1, v) * fold;
    const float inverse = 1 / std::sqrt(nx * nx + ny * ny + w * w);
    x[i] = nx * inverse;
    y[i] = ny * inverse;
    z[i] = w * inverse;
  }
  return true;
}

void putColors(PayloadWriter& writer, const Axes& values, bool full_precision) {
  const float largest = std::max(
      {rangeOf(values[0]).greatest, rangeOf(values[1]).greatest, rangeOf(values[2]).greatest});
  if (!(largest > 0)) return writer.put(std::uint8_t{kFormZero});
  if (full_precision) return putAxesAsFloats(writer, values);
  // The power of two brings the largest value to [2^14, 2^15): the full range of a half
  const int exponent = clampedExponent(std::ilogb(largest) - 14);
  writer.put(std::uint8_t{2});
  writer.put(static_cast<std::int8_t>(exponent));
  // Rounding the largest floats up would make them infinite: 32752 is the last half below 2^15
  const float limit = exponent == 113 ? 32752.f : 65504.f;
  const float scale = powerOfTwo(-exponent);
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values[0].size());
  for (const std::span<const float> axis : values) {
    const float* const from = axis.data();
    std::uint16_t* const to = codes.data();
    for (std::size_t i = 0; i < codes.size(); ++i) {
      const float scaled = from[i] * scale;
      to[i] = static_cast<std::uint16_t>(halfFromFloat(scaled < limit ? scaled : limit));
    }
    putDifferences<2, std::uint16_t>(writer, codes);
  }
}

bool getColors(PayloadReader& reader, const MutableAxes& values) {
  const std::uint8_t form = reader.packed.get<std::uint8_t>();
  if (form == kFormZero) {
    for (const std::span<float> axis : values) std::fill(axis.begin(), axis.end(), 0.f);
    return reader.ok();
  }
  if (form == kFormFloat) {
    return getAxesAsFloats(reader, values) && allNonNegative(constAxes(values));
  }
  if (form != 2) return false;
  const float scale = powerOfTwo(clampedExponent(reader.packed.get<std::int8_t>()));
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values[0].size());
  for (const std::span<float> axis : values) {
    if (!getDifferences<2>(reader, codes)) return false;
    std::uint16_t largest = 0;
    for (const std::uint16_t code : codes) largest = std::max(largest, code);
    if (largest >= kHalfInfinity) return false;
    // In the place of a float's exponent a half's is 112 too small
    const std::uint16_t* const from = codes.data();
    float* const to = axis.data();
    for (std::size_t i = 0; i < codes.size(); ++i) {
      to[i] = std::bit_cast<float>(std::uint32_t{from[i]} << 13) * 0x1p112f * scale;
    }
    if (!allFinite(axis)) return false;
  }
  return true;
}

bool getRadiosity(PayloadReader& reader, const MutableAxes& values) {
  constexpr float kLargest = kLargestColor * (1 + 0x1p-10f);
  if (!getColors(reader, values)) return false;
  return std::all_of(values.begin(), values.end(), [](std::span<const float> axis) {
    float largest = 0;
    for (const float value : axis) largest = std::max(largest, value);
    return largest <= kLargest;
  });
}

void putReflectances(PayloadWriter& writer, const Axes& values, bool full_precision) {
  if (full_precision) return putAxesAsFloats(writer, values);
  writer.put(std::uint8_t{2});
  const std::span<std::uint8_t> codes = scratch<std::uint8_t, Use::kCodes>(values[0].size());
  for (const std::span<const float> axis : values) {
    const float* const from = axis.data();
    std::uint8_t* const to = codes.data();
    for (std::size_t i = 0; i < codes.size(); ++i) {
      const float value = from[i] < 1 ? from[i] : 1;
      to[i] = static_cast<std::uint8_t>(static_cast<std::int32_t>(std::sqrt(value) * 255 + 0.5f));
    }
    putDifferences<1, std::uint8_t>(writer, codes);
  }
}

bool getReflectances(PayloadReader& reader, const MutableAxes& values) {
  const std::uint8_t form = reader.packed.get<std::uint8_t>();
  if (form == kFormFloat) {
    return getAxesAsFloats(reader, values) && allNonNegative(constAxes(values));
  }
  if (form != 2) return false;
  const std::span<std::uint8_t> codes = scratch<std::uint8_t, Use::kCodes>(values[0].size());
  for (const std::span<float> axis : values) {
    if (!getDifferences<1>(reader, codes)) return false;
    const std::uint8_t* const from = codes.data();
    float* const to = axis.data();
    for (std::size_t i = 0; i < codes.size(); ++i) {
      const float root = float(std::int32_t{from[i]}) * (1.f / 255);
      to[i] = root * root;
    }
  }
  return true;
}

void putSigned(PayloadWriter& writer, std::span<const float> values, float limit) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    codes[i] = static_cast<std::uint16_t>(signedCode(values[i], limit));
  }
  putDifferences<2, std::uint16_t>(writer, codes);
}

bool getSigned(PayloadReader& reader, std::span<float> values, float limit) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  if (!getDifferences<2>(reader, codes)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = float(static_cast<std::int16_t>(codes[i])) * (limit / 32767);
  }
  return true;
}

void putSmallIntegers(PayloadWriter& writer, std::span<const std::int16_t> values) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    codes[i] = folded<2>(static_cast<std::uint16_t>(values[i]));
  }
  putPlanes<2, std::uint16_t>(writer, codes);
}

bool getSmallIntegers(PayloadReader& reader, std::span<std::int16_t> values) {
  const std::span<std::uint16_t> codes = scratch<std::uint16_t, Use::kCodes>(values.size());
  if (!getPlanes<2>(reader, codes)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<std::int16_t>(unfolded(codes[i]));
  }
  return true;
}

void putCounts(PayloadWriter& writer, std::span<const std::uint64_t> values) {
  const std::uint64_t largest =
      values.empty() ? 0 : *std::max_element(values.begin(), values.end());
  const int width = largest < 0x100 ? 1 : largest < 0x10000 ? 2 : largest < 0x100000000 ? 4 : 8;
  writer.put(static_cast<std::uint8_t>(width));
  switch (width) {
    case 1:
      return putDifferences<1>(writer, values);
    case 2:
      return putDifferences<2>(writer, values);
    case 4:
      return putDifferences<4>(writer, values);
    default:
      return putDifferences<8>(writer, values);
  }
}

bool getCounts(PayloadReader& reader, std::span<std::uint64_t> values) {
  switch (reader.packed.get<std::uint8_t>()) {
    case 1:
      return getDifferences<1>(reader, values);
    case 2:
      return getDifferences<2>(reader, values);
    case 4:
      return getDifferences<4>(reader, values);
    case 8:
      return getDifferences<8>(reader, values);
    default:
      return false;
  }
}

void putBytes8(PayloadWriter& writer, std::span<const std::uint8_t> values) {
  if (!values.empty()) std::memcpy(writer.addPacked(values.size()), values.data(), values.size());
}

bool getBytes8(PayloadReader& reader, std::span<std::uint8_t> values) {
  const std::span<const std::byte> bytes = reader.packed.take(values.size());
  if (!reader.ok()) return false;
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return true;
}

void putFloats(PayloadWriter& writer, std::span<const float> values) {
  const std::span<std::uint32_t> bits = scratch<std::uint32_t, Use::kCodes>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) bits[i] = std::bit_cast<std::uint32_t>(values[i]);
  putPlanes<4, std::uint32_t>(writer, bits);
}

bool getFloats(PayloadReader& reader, std::span<float> values) {
  const std::span<std::uint32_t> bits = scratch<std::uint32_t, Use::kCodes>(values.size());
  if (!getPlanes<4>(reader, bits)) return false;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::bit_cast<float>(bits[i]);
  return allFinite(values);
}

}  // namespace surfeit
