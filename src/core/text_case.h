// Characters, and texts whose case does not matter: extensions, names of channels, statements of
// files.
#pragma once

#include <algorithm>
#include <cctype>
#include <string_view>

namespace surfeit {

constexpr bool isDigit(char c) { return c >= '0' && c <= '9'; }

inline bool isSameInAnyCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](unsigned char x, unsigned char y) {
    return std::tolower(x) == std::tolower(y);
  });
}

// Whether a name ends so.
inline bool hasEnding(std::string_view name, std::string_view ending) {
  return name.size() >= ending.size() &&
         isSameInAnyCase(name.substr(name.size() - ending.size()), ending);
}

}  // namespace surfeit
