// The meaning of color numbers where a file does not state it.
#pragma once

#include <cstdint>

namespace surfeit {

// Bytes (uchar) are always sRGB of 8 bits; radiosity in reals is always scene-linear.
enum class ColorRange : std::uint8_t {
  // Decided by a sample of the whole file. Integers are 8 bits if none exceeds 255, else 16. Reals
  // are scene-linear, unless all are whole numbers and the largest is above 1 and at most 255: then
  // they are 8 bits. A note reports the rule that was applied.
  kAuto,
  k8,     // sRGB of 8 bits: 255 is white
  k16,    // sRGB of 16 bits: 65535 is white
  kUnit,  // reals are scene-linear, 1 is white; integers as with kAuto
};

}  // namespace surfeit
