// How the values of a PLY file are stored.
#pragma once

#include <cstdint>

namespace surfeit {

enum class PlyEncoding : std::uint8_t { kAscii, kBinaryLittleEndian, kBinaryBigEndian };

}  // namespace surfeit
