// Checks of numbers, for options.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "surfeit/generate.h"
#include "surfeit/status.h"

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

// Counts such as 500k, 10M or 4096 (parseSurfelCount), as digits: for CLI::Option::transform.
inline const CLI::Validator kUnitCount(
    [](std::string& text) {
      const Result<std::uint64_t> count = parseSurfelCount(text);
      if (!count.ok()) return count.status().message();
      text = std::to_string(*count);
      return std::string();
    },
    "COUNT");

}  // namespace surfeit
