// Transparencies of the records of a page, or their tints: two columns of bytes, the low ones and
// the high ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "octree/page/column_codec.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Whether green and blue have valid codes; that of red is valid.
inline bool areTransparencies(std::uint16_t red, const Tint& tint) {
  return transparencyOf(red, tint, 1) <= kMostTransparency &&
         transparencyOf(red, tint, 2) <= kMostTransparency;
}

struct TransparencyColumns {
  std::array<std::span<std::uint8_t>, 2> bytes;

  void set(std::size_t i, std::uint16_t transparency) const {
    bytes[0][i] = static_cast<std::uint8_t>(transparency & 0xff);
    bytes[1][i] = static_cast<std::uint8_t>(transparency >> 8);
  }
  std::uint16_t at(std::size_t i) const {
    return static_cast<std::uint16_t>(bytes[0][i] | bytes[1][i] << 8);
  }

  void put(PayloadWriter& writer) const {
    for (const auto& column : bytes) putBytes8(writer, column);
  }
  // False when the columns end early.
  bool getCodes(PayloadReader& reader) const {
    for (const auto& column : bytes) {
      if (!getBytes8(reader, column)) return false;
    }
    return true;
  }
  // Or hold what is no transparency.
  bool get(PayloadReader& reader) const {
    if (!getCodes(reader)) return false;
    for (std::size_t i = 0; i < bytes[0].size(); ++i) {
      if (at(i) > kMostTransparency) return false;
    }
    return true;
  }
};

// What records with tints have beside: the differences of green and of blue.
struct TintColumns {
  std::array<TransparencyColumns, 2> differences;

  void set(std::size_t i, const Tint& tint) const {
    for (std::size_t k = 0; k < 2; ++k) differences[k].set(i, tint[k]);
  }
  Tint at(std::size_t i) const { return {differences[0].at(i), differences[1].at(i)}; }
  void put(PayloadWriter& writer) const {
    for (const TransparencyColumns& column : differences) column.put(writer);
  }
  // False when the columns end early, or give with those of red what is no transparency.
  bool get(PayloadReader& reader, const TransparencyColumns& red) const {
    for (const TransparencyColumns& column : differences) {
      if (!column.getCodes(reader)) return false;
    }
    for (std::size_t i = 0; i < red.bytes[0].size(); ++i) {
      if (!areTransparencies(red.at(i), at(i))) return false;
    }
    return true;
  }
};

}  // namespace surfeit
