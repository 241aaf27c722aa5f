// Bytes of what tests write, and of what they compare.
#pragma once

#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "storage/positional_file.h"
#include "surfeit/surfel.h"

namespace surfeit {

inline Bytes bytesOf(const std::string& text) { return std::as_bytes(std::span(text)); }

// Those of a number as this machine has them: little-endian.
template <typename T>
std::string littleEndian(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

// Surfels have no padding, so that their bytes tell whether they are equal.
inline bool areEqual(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Surfel)) == 0);
}

}  // namespace surfeit
