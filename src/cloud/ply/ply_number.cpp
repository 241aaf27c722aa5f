#include "cloud/ply/ply_number.h"

#include <charconv>
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

// Numbers too large for the type become infinite and numbers too small become zero, as in C.
template <typename T>
bool storeReal(std::string_view text, std::byte* out) {
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size()) return false;
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

char* formatPlyNumber(const std::byte* bytes, ValueType type, char* out) {
  return visitValueType(type, [bytes, out]<typename T>(std::type_identity<T>) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return std::to_chars(out, out + kLongestPlyNumber, value).ptr;
  });
}

}  // namespace surfeit
