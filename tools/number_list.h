// Options that hold several numbers in one word: --eye "1 2 3", or 1,2,3.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>

namespace surfeit {

// Exactly N finite numbers, separated by spaces or commas. Throws CLI's usage error, which names
// the option, what was found and what `expected` looks like.
template <std::size_t N>
std::array<double, N> parseNumberList(const std::string& option, std::string_view text,
                                      std::string_view expected) {
  constexpr std::string_view kSeparators = " ,\t";
  std::array<double, N> numbers{};
  std::size_t count = 0;
  bool ok = true;
  std::string_view rest = text;
  while (ok) {
    rest.remove_prefix(std::min(rest.find_first_not_of(kSeparators), rest.size()));
    if (rest.empty()) break;
    const std::string_view token = rest.substr(0, rest.find_first_of(kSeparators));
    double number = 0;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), number);
    ok = error == std::errc() && end == token.data() + token.size() && std::isfinite(number) &&
         count < N;
    if (ok) numbers[count++] = number;
    rest.remove_prefix(token.size());
  }
  if (ok && count == N) return numbers;
  throw CLI::ValidationError(option, fmt::format("found \"{}\", expected {}", text, expected));
}

}  // namespace surfeit
