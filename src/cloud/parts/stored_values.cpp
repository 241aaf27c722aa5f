#include "cloud/parts/stored_values.h"

#include <Imath/half.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace surfeit {
namespace {

struct Half {
  std::uint16_t bits;
};

template <std::size_t Bytes>
using Bits = std::conditional_t<
    Bytes == 1, std::uint8_t,
    std::conditional_t<Bytes == 2, std::uint16_t,
                       std::conditional_t<Bytes == 4, std::uint32_t, std::uint64_t>>>;

template <typename T>
T swapped(T bits) {
  if constexpr (sizeof(T) == 2) return __builtin_bswap16(bits);
  if constexpr (sizeof(T) == 4) return __builtin_bswap32(bits);
  if constexpr (sizeof(T) == 8) return __builtin_bswap64(bits);
  return bits;
}

template <typename In, typename Out, bool kSwap>
void decodeValue(const std::byte* from, std::byte* to) {
  Bits<sizeof(In)> bits;
  std::memcpy(&bits, from, sizeof bits);
  if constexpr (kSwap) bits = swapped(bits);
  Out value;
  if constexpr (std::is_same_v<In, Half>) {
    value = imath_half_to_float(bits);
  } else {
    value = static_cast<Out>(std::bit_cast<In>(bits));
  }
  std::memcpy(to, &value, sizeof value);
}

// A constant number of components lets the compiler unroll the inner loop; 0 is any number.
template <typename In, typename Out, bool kSwap, std::size_t kComponents>
void decodeAll(const StoredPlace& place, const std::byte* from, std::size_t count, std::byte* to,
               std::size_t to_stride) {
  const std::size_t components = kComponents > 0 ? kComponents : place.components;
  for (std::size_t i = 0; i < count; ++i, from += place.stride, to += to_stride) {
    for (std::size_t c = 0; c < components; ++c) {
      decodeValue<In, Out, kSwap>(from + c * sizeof(In), to + c * sizeof(Out));
    }
  }
}

template <typename In, typename Out, bool kSwap>
void decodeComponents(const StoredPlace& place, const std::byte* from, std::size_t count,
                      std::byte* to, std::size_t to_stride) {
  if (place.components == 1) return decodeAll<In, Out, kSwap, 1>(place, from, count, to, to_stride);
  if (place.components == 3) return decodeAll<In, Out, kSwap, 3>(place, from, count, to, to_stride);
  decodeAll<In, Out, kSwap, 0>(place, from, count, to, to_stride);
}

template <typename In, typename Out>
void decodeAs(const StoredPlace& place, const std::byte* from, std::size_t count, std::byte* to,
              std::size_t to_stride) {
  if (place.is_swapped) return decodeComponents<In, Out, true>(place, from, count, to, to_stride);
  decodeComponents<In, Out, false>(place, from, count, to, to_stride);
}

struct TypeFacts {
  std::size_t bytes;
  std::string_view name;
  ValueType ply;
};
constexpr std::array<TypeFacts, 11> kTypes{{{1, "int8", ValueType::kInt8},
                                            {1, "uint8", ValueType::kUint8},
                                            {2, "int16", ValueType::kInt16},
                                            {2, "uint16", ValueType::kUint16},
                                            {4, "int32", ValueType::kInt32},
                                            {4, "uint32", ValueType::kUint32},
                                            {8, "int64", ValueType::kFloat64},
                                            {8, "uint64", ValueType::kFloat64},
                                            {2, "float16", ValueType::kFloat32},
                                            {4, "float32", ValueType::kFloat32},
                                            {8, "float64", ValueType::kFloat64}}};

const TypeFacts& factsOf(StoredType type) { return kTypes[static_cast<std::size_t>(type)]; }

}  // namespace

std::size_t storedBytes(StoredType type) { return factsOf(type).bytes; }
std::string_view storedTypeName(StoredType type) { return factsOf(type).name; }
ValueType plyTypeOf(StoredType type) { return factsOf(type).ply; }

StoredType storedTypeOf(ValueType type) {
  constexpr std::array<StoredType, 8> kStored{
      StoredType::kInt8,  StoredType::kUint8,  StoredType::kInt16,   StoredType::kUint16,
      StoredType::kInt32, StoredType::kUint32, StoredType::kFloat32, StoredType::kFloat64};
  return kStored[static_cast<std::size_t>(type)];
}

void decodeStored(const StoredPlace& place, const std::byte* from, std::size_t count, std::byte* to,
                  std::size_t to_stride) {
  switch (place.type) {
    case StoredType::kInt64:
      return decodeAs<std::int64_t, double>(place, from, count, to, to_stride);
    case StoredType::kUint64:
      return decodeAs<std::uint64_t, double>(place, from, count, to, to_stride);
    case StoredType::kFloat16:
      return decodeAs<Half, float>(place, from, count, to, to_stride);
    default:
      break;
  }
  // All others stay what they are; as bits, so that NaNs keep theirs
  switch (storedBytes(place.type)) {
    case 1:
      return decodeAs<std::uint8_t, std::uint8_t>(place, from, count, to, to_stride);
    case 2:
      return decodeAs<std::uint16_t, std::uint16_t>(place, from, count, to, to_stride);
    case 4:
      return decodeAs<std::uint32_t, std::uint32_t>(place, from, count, to, to_stride);
    default:
      return decodeAs<std::uint64_t, std::uint64_t>(place, from, count, to, to_stride);
  }
}

ChannelKind guessChannelKind(std::string_view name, std::size_t components) {
  if (components == 16) return ChannelKind::kMatrix;
  if (components != 3) return ChannelKind::kFloat;
  std::string lower(name);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  constexpr std::string_view kWords[] = {"color",     "colour",     "rgb",      "albedo",
                                         "radiosity", "irradiance", "emission", "radiance"};
  for (const std::string_view word : kWords) {
    if (lower.find(word) != std::string::npos) return ChannelKind::kColor;
  }
  if (lower == "cd" || lower == "ci" || lower == "cs") return ChannelKind::kColor;
  return ChannelKind::kVector;
}

bool keepsProperties(const RowLayout& element, const RowChannel& channel, std::string_view name) {
  const std::size_t components = channel.properties.size();
  const std::vector<std::string> read =
      propertyNames(name, components, guessChannelKind(name, components), {});
  if (read.size() != components) return false;
  for (std::size_t c = 0; c < components; ++c) {
    if (element.properties[channel.properties[c]].name != read[c]) return false;
  }
  return true;
}

}  // namespace surfeit
