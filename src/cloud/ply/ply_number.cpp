#include "cloud/ply/ply_number.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace surfeit {
namespace {

template <typename T>
bool storeInteger(std::string_view text, std::byte* out) {
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return false;
  std::memcpy(out, &value, sizeof value);
  return true;
}

template <typename T>
bool storeReal(std::string_view text, std::byte* out);

// Numbers as Fortran has them, 1.5D+00, and as old programs of Windows do: 1.#QNAN,
// -1.#IND, 1.#INF. `read`: the characters that are a number by the rules of C.
template <typename T>
bool storeForeignReal(std::string_view text, std::size_t read, std::byte* out) {
  if (text.substr(read).starts_with('#') && read > 0) {
    const std::string_view name = text.substr(read + 1);
    T value = std::numeric_limits<T>::quiet_NaN();
    if (name.starts_with("INF")) {
      value = std::numeric_limits<T>::infinity() * (text[0] == '-' ? -1 : 1);
    } else if (!name.starts_with("IND") && !name.starts_with("QNAN") && !name.starts_with("SNAN")) {
      return false;
    }
    std::memcpy(out, &value, sizeof value);
    return true;
  }
  if (read == 0 || read + 1 >= text.size() || (text[read] != 'd' && text[read] != 'D'))
    return false;
  char copy[kMaxPlyNumberChars];
  std::memcpy(copy, text.data(), text.size());
  copy[read] = 'e';
  return storeReal<T>({copy, text.size()}, out);
}

// Numbers too large for the type become infinite and numbers too small become zero, as in C.
template <typename T>
bool storeReal(std::string_view text, std::byte* out) {
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size()) {
    return storeForeignReal<T>(text, static_cast<std::size_t>(end - text.data()), out);
  }
  if (error == std::errc::result_out_of_range) {
    // A float may be small without an exponent; a double of kMaxPlyNumberChars digits may not
    double wide = 0;
    const auto [wide_end, wide_error] =
        std::from_chars(text.data(), text.data() + text.size(), wide);
    const bool is_tiny = wide_error == std::errc::result_out_of_range
                             ? text.find("e-") != text.npos || text.find("E-") != text.npos
                             : wide > -1 && wide < 1;
    value = is_tiny ? T{0} : std::numeric_limits<T>::infinity();
    if (text.front() == '-') value = -value;
  } else if (error != std::errc{}) {
    return false;
  }
  // One nan, whatever sign it is printed with
  if (std::isnan(value)) value = std::numeric_limits<T>::quiet_NaN();
  std::memcpy(out, &value, sizeof value);
  return true;
}

}  // namespace

bool parsePlyNumber(std::string_view text, ValueType type, std::byte* out) {
  if (text.size() > kMaxPlyNumberChars) return false;
  // from_chars reads no plus sign
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  return visitValueType(type, [text, out]<typename T>(std::type_identity<T>) {
    if constexpr (std::is_integral_v<T>) {
      return storeInteger<T>(text, out);
    } else {
      return storeReal<T>(text, out);
    }
  });
}

bool floatHolds(std::string_view text) {
  double value = 0, power = 0;
  float single = 0;
  const auto read = [](std::string_view number, ValueType type, auto& out) {
    return parsePlyNumber(number, type, reinterpret_cast<std::byte*>(&out));
  };
  if (!read(text, ValueType::kFloat64, value) || !std::isfinite(value)) return true;
  if (!read(text, ValueType::kFloat32, single)) return true;
  const std::size_t exponent_at = std::min(text.find_first_of("eE"), text.size());
  const std::size_t point_at = std::min(text.find('.'), exponent_at);
  double decimals = point_at < exponent_at ? double(exponent_at - point_at - 1) : 0;
  if (exponent_at < text.size() && read(text.substr(exponent_at + 1), ValueType::kFloat64, power)) {
    decimals -= power;
  }
  // A little more than half a unit: floats are often exactly half way, and both sides are rounded
  return std::abs(double(single) - value) <= (0.5 + 1e-6) * std::pow(10., -decimals);
}

char* formatPlyNumber(const std::byte* bytes, ValueType type, char* out) {
  return visitValueType(type, [bytes, out]<typename T>(std::type_identity<T>) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return std::to_chars(out, out + kLongestPlyNumber, value).ptr;
  });
}

}  // namespace surfeit
