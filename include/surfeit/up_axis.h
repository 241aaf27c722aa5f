// The axis of a scene that points up.
#pragma once

#include <cstdint>

namespace surfeit {

// Clouds say theirs by a comment "up z" (docs/files.md), and LAS files have z; others have y.
enum class UpAxis : std::uint8_t { kX, kY, kZ };

inline constexpr UpAxis kDefaultUpAxis = UpAxis::kY;

}  // namespace surfeit
