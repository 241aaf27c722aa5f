// How the numbers of colors are read that do not say themselves what they mean.
#pragma once

#include <cstdint>

namespace surfeit {

// Bytes (uchar) are always sRGB of 8 bits; radiosity in reals is always scene-linear.
enum class ColorRange : std::uint8_t {
  // Values of a sample of the whole file tell: integers that never exceed 255 are 8 bits, others
  // 16; reals are scene-linear unless all are whole numbers and the largest is above 1 and at most
  // 255, which makes them 8 bits. The rule that was applied is told.
  kAuto,
  k8,     // sRGB of 8 bits: 255 is white
  k16,    // sRGB of 16 bits: 65535 is white
  kUnit,  // reals are scene-linear, 1 is white; integers as with kAuto
};

}  // namespace surfeit
