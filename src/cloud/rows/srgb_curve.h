// The transfer function of sRGB (IEC 61966-2-1), by which integers of 8 and 16 bits code colors
// (docs/format.md).
#pragma once

#include <cmath>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// Whether a color of this type is coded by the curve; others are scene-linear.
inline bool codesSrgb(ValueType type) {
  return type == ValueType::kUint8 || type == ValueType::kUint16;
}

// From a code from 0 to 1 to scene-linear light from 0 to 1.
inline double linearFromSrgbCode(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

}  // namespace surfeit
