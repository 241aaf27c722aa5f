// Checks of numbers, for options.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <string>

namespace surfeit {

// Finite numbers from 0 on, or above it. (CLI11's own name the largest double, in 309 digits.)
inline CLI::Validator numberCheck(bool may_be_zero) {
  const auto check = [may_be_zero](const std::string& text) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    const bool is_number = end != text.c_str() && *end == '\0' && std::isfinite(value);
    if (is_number && (value > 0 || (may_be_zero && value == 0))) return std::string();
    return fmt::format("{}: expected a finite number {}", text,
                       may_be_zero ? "from 0 on" : "above 0");
  };
  return CLI::Validator(check, may_be_zero ? "NONNEGATIVE" : "POSITIVE");
}

inline const CLI::Validator kPositiveNumber = numberCheck(false);
inline const CLI::Validator kNonNegativeNumber = numberCheck(true);

}  // namespace surfeit
