#include "cloud/rows/number_change.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "cloud/rows/srgb_curve.h"

namespace surfeit {
namespace {

template <typename T>
T load(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}
template <typename T>
void store(std::byte* bytes, T value) {
  std::memcpy(bytes, &value, sizeof value);
}

// The code, or -1 when the value is none. Signed integers of 8 and 16 bits stand for their bits.
template <typename T>
double codeOf(T value, const NumberChange& change) {
  double code;
  if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
    code = static_cast<double>(static_cast<std::make_unsigned_t<T>>(value));
  } else {
    code = static_cast<double>(value);
  }
  if (!(code >= 0 && code == std::floor(code))) return -1;
  if (code > change.white) return change.takes_larger ? change.white : -1;
  return code;
}

// Each returns the number of rows done: less than `count` when the next one's value is none.
template <typename T>
std::size_t toCodes(const NumberChange& change, std::byte* row, std::size_t count,
                    std::size_t row_bytes) {
  std::byte* at = row + change.property.offset;
  for (std::size_t i = 0; i < count; ++i, at += row_bytes) {
    const double code = codeOf(load<T>(at), change);
    if (code < 0) return i;
    if (change.kind == NumberChange::Kind::kCode16) {
      store(at, static_cast<std::uint16_t>(std::lround(code * (65535 / change.white))));
    } else {
      store(at, static_cast<std::uint8_t>(code));
    }
  }
  return count;
}

// What is no code, below 0 or not finite, stays: the mapping to surfels tells.
template <typename T>
std::size_t toLight(const NumberChange& change, std::byte* row, std::size_t count,
                    std::size_t row_bytes) {
  std::byte* at = row + change.property.offset;
  for (std::size_t i = 0; i < count; ++i, at += row_bytes) {
    const double value = static_cast<double>(load<T>(at));
    if (value >= 0) store(at, static_cast<T>(linearFromSrgbCode(value / change.white)));
  }
  return count;
}

// The middle of the range becomes 0: [0, 255] is [-128, 127].
template <typename T>
void toDirections(const NumberChange& change, std::byte* row, std::size_t count,
                  std::size_t row_bytes) {
  constexpr T kMiddle = T(T{1} << (8 * sizeof(T) - 1));
  std::byte* at = row + change.property.offset;
  for (std::size_t i = 0; i < count; ++i, at += row_bytes) store(at, T(load<T>(at) - kMiddle));
}

template <typename T>
void toFlags(const NumberChange& change, std::byte* row, std::size_t count, std::size_t row_bytes) {
  std::byte* at = row + change.property.offset;
  for (std::size_t i = 0; i < count; ++i, at += row_bytes) {
    store(at, static_cast<std::uint8_t>(load<T>(at) != T{0} ? 255 : 0));
  }
}

template <typename T>
std::size_t unpack(const NumberChange& change, std::byte* row, std::size_t count,
                   std::size_t row_bytes) {
  std::byte* at = row + change.property.offset;
  for (std::size_t i = 0; i < count; ++i, at += row_bytes) {
    const T value = load<T>(at);
    std::uint32_t bits;
    if constexpr (std::is_integral_v<T>) {
      bits = static_cast<std::uint32_t>(value);
    } else if (change.kind == NumberChange::Kind::kPackedNumber) {
      // Signed integers have alpha above 127 below 0
      if (!(value >= -2147483648.0 && value <= 4294967295.0 && value == std::floor(value)))
        return i;
      bits = static_cast<std::uint32_t>(static_cast<std::int64_t>(value));
    } else {
      bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
      if (bits == kNoPackedColor) bits = 0;
    }
    const std::uint8_t codes[4] = {
        static_cast<std::uint8_t>(bits >> 16), static_cast<std::uint8_t>(bits >> 8),
        static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 24)};
    std::memcpy(at, codes, sizeof codes);
  }
  return count;
}

}  // namespace

std::size_t changeNumbers(const NumberChange& change, std::byte* rows, std::size_t count,
                          std::size_t row_bytes) {
  return visitValueType(change.property.type, [&]<typename T>(std::type_identity<T>) {
    switch (change.kind) {
      case NumberChange::Kind::kCode8:
      case NumberChange::Kind::kCode16:
        if constexpr (sizeof(T) >= 2) return toCodes<T>(change, rows, count, row_bytes);
        return count;  // bytes are codes, signed or not
      case NumberChange::Kind::kLight:
        if constexpr (std::is_floating_point_v<T>) {
          return toLight<T>(change, rows, count, row_bytes);
        }
        return count;
      case NumberChange::Kind::kFlag:
        toFlags<T>(change, rows, count, row_bytes);
        return count;
      case NumberChange::Kind::kDirection:
        if constexpr (std::is_unsigned_v<T>) toDirections<T>(change, rows, count, row_bytes);
        return count;
      default:
        if constexpr (sizeof(T) >= 4) return unpack<T>(change, rows, count, row_bytes);
        return count;
    }
  });
}

}  // namespace surfeit
