// Colors packed into one number, in texts.
#pragma once

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "cloud/rows/number_change.h"

namespace surfeit {

// A number in a field of floats is the color itself, or a float that has its bits: these are
// below 1e-30 or above 2^32.
inline std::uint32_t packedBits(double value) {
  if (std::abs(value) >= 1 && value == std::floor(value)) {
    if (value > 0 && value <= 4294967295.0) return static_cast<std::uint32_t>(value);
    if (value < 0 && value >= -2147483648.0) {
      return static_cast<std::uint32_t>(static_cast<std::int32_t>(value));
    }
  }
  return std::isnan(value) ? kNoPackedColor
                           : std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

// What a text with too few digits has lost: 4.2108e+06 is 4210800, where the color was 4210752.
struct LostDigits {
  std::uint64_t long_values = 0, round_values = 0;  // of seven digits or more; that end with 0
  double least = std::numeric_limits<double>::infinity();
  double largest = -std::numeric_limits<double>::infinity();

  void add(double value) {
    constexpr double kSevenDigits = 1e6, kMostColor = 4294967295.0;
    if (!(value >= kSevenDigits && value <= kMostColor)) return;
    ++long_values;
    round_values += std::fmod(value, 10) == 0 ? 1 : 0;
    least = std::fmin(least, value);
    largest = std::fmax(largest, value);
  }
  // All of several colors end with 0.
  bool areLost() const { return round_values == long_values && least < largest; }
  // Of a color of that name.
  std::string describe(std::string_view color, std::string_view advice) const {
    return fmt::format(
        "{} ends with 0 in all of {} records looked at that have more than six digits: the text "
        "lost the last ones, which are most of blue: {}",
        color, long_values, advice);
  }
};

}  // namespace surfeit
