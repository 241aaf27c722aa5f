// Numbers of ascii PLY files.
#pragma once

#include <cstddef>
#include <string_view>

#include "cloud/ply/ply_format.h"

namespace surfeit {

// Longest number that is read. With at most this many digits the sign of the exponent tells whether
// a number that from_chars finds out of range is too large or too small.
inline constexpr std::size_t kMaxPlyNumberChars = 256;
// Longest number that is written; -2.2250738585072014e-308 comes near.
inline constexpr std::size_t kLongestPlyNumber = 32;

// Stores the number that `text` spells at `out`, in host byte order; false when it spells no number
// of that type. Reals too large for the type become infinite, and too small ones zero.
bool parsePlyNumber(std::string_view text, ValueType type, std::byte* out);

// Whether the float next to the number that `text` spells gives it back, written with as many
// decimals. So do floats that a program wrote with more decimals than they have.
bool floatHolds(std::string_view text);

// Writes the shortest text that reads back as the value at `bytes` to `out`, which has room for
// kLongestPlyNumber characters. Returns its end.
char* formatPlyNumber(const std::byte* bytes, ValueType type, char* out);

}  // namespace surfeit
