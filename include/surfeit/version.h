// The version of the library, and of the file format that it writes.
#pragma once

#include <cstdint>

namespace surfeit {

inline constexpr const char* kVersion = "0.1.0";

// docs/format.md; a reader refuses a newer format and keeps reading every older one. Scenes with
// lobes of glossy bounces are of version 4, others with opacity of version 3. All others are of
// version 2, and stay readable by programs that know no newer one.
inline constexpr std::uint32_t kFormatVersion = 4;

}  // namespace surfeit
