#include "io/ply_number.h"

#include <charconv>
#include <cstdint>
#include <cstring>
#include <limits>

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

template <typename T>
char* formatAs(const std::byte* bytes, char* out) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return std::to_chars(out, out + kLongestPlyNumber, value).ptr;
}

}  // namespace

bool parsePlyNumber(std::string_view text, PlyType type, std::byte* out) {
  if (text.size() > kMaxPlyNumberChars) return false;
  // from_chars reads no plus sign
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  switch (type) {
    case PlyType::kInt8:
      return storeInteger<std::int8_t>(text, out);
    case PlyType::kUint8:
      return storeInteger<std::uint8_t>(text, out);
    case PlyType::kInt16:
      return storeInteger<std::int16_t>(text, out);
    case PlyType::kUint16:
      return storeInteger<std::uint16_t>(text, out);
    case PlyType::kInt32:
      return storeInteger<std::int32_t>(text, out);
    case PlyType::kUint32:
      return storeInteger<std::uint32_t>(text, out);
    case PlyType::kFloat32:
      return storeReal<float>(text, out);
    case PlyType::kFloat64:
      break;
  }
  return storeReal<double>(text, out);
}

char* formatPlyNumber(const std::byte* bytes, PlyType type, char* out) {
  switch (type) {
    case PlyType::kInt8:
      return formatAs<std::int8_t>(bytes, out);
    case PlyType::kUint8:
      return formatAs<std::uint8_t>(bytes, out);
    case PlyType::kInt16:
      return formatAs<std::int16_t>(bytes, out);
    case PlyType::kUint16:
      return formatAs<std::uint16_t>(bytes, out);
    case PlyType::kInt32:
      return formatAs<std::int32_t>(bytes, out);
    case PlyType::kUint32:
      return formatAs<std::uint32_t>(bytes, out);
    case PlyType::kFloat32:
      return formatAs<float>(bytes, out);
    case PlyType::kFloat64:
      break;
  }
  return formatAs<double>(bytes, out);
}

}  // namespace surfeit
