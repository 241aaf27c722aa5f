// The axis of a scene that points up.
#pragma once

#include <cstdint>

namespace surfeit {

// Clouds may state it in a comment "up z" (docs/files.md). Otherwise it is z for LAS files, else y.
enum class UpAxis : std::uint8_t { kX, kY, kZ };

inline constexpr UpAxis kDefaultUpAxis = UpAxis::kY;

}  // namespace surfeit
