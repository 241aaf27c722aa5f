// Numbers that look random.
#pragma once

#include <cstdint>

namespace surfeit {

// Well-mixed bits of a number (SplitMix64, Steele et al. 2014).
inline std::uint64_t splitMix(std::uint64_t value) {
  value += 0x9e3779b97f4a7c15u;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9u;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebu;
  return value ^ (value >> 31);
}

}  // namespace surfeit
