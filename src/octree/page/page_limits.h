// How much a page holds.
#pragma once

#include <cstdint>

namespace surfeit {

// Groups by default. Node frames of 41 KiB and surfel frames of 32 KiB are what one device read
// costs anyway.
inline constexpr std::uint32_t kDefaultNodeGroup = 128;
inline constexpr std::uint32_t kDefaultSurfelGroup = 512;

}  // namespace surfeit
