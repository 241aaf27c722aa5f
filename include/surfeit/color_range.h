// The meaning of color numbers where a file does not state it.
#pragma once

#include <cstdint>

namespace surfeit {

// Bytes (uchar) are always sRGB of 8 bits; radiosity in reals is always scene-linear.
enum class ColorRange : std::uint8_t {
  // Decided by a sample of the whole file. Integers are 8 bits if none exceeds 255, 10 or 12 if the
  // largest needs all of these bits (512 to 1023, 2048 to 4095), else 16. Reals are scene-linear,
  // unless all are whole numbers and the largest is 16 to 255: then they are 8 bits. A note reports
  // the rule that was applied.
  kAuto,
  k8,     // sRGB of 8 bits: 255 is white
  k16,    // sRGB of 16 bits: 65535 is white
  kUnit,  // reals are scene-linear, 1 is white; integers as with kAuto
  k10,    // sRGB of 10 bits: 1023 is white
  k12,    // sRGB of 12 bits: 4095 is white
};

}  // namespace surfeit
