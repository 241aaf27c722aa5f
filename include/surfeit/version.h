// The version of the library, and of the file format that it writes.
#pragma once

#include <cstdint>

namespace surfeit {

inline constexpr const char* kVersion = "0.1.0";

// docs/format.md; a reader refuses a newer format and keeps reading every older one.
inline constexpr std::uint32_t kFormatVersion = 2;

}  // namespace surfeit
