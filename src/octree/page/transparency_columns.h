// Transparencies of the records of a page: two columns of bytes, the low ones and the high ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "octree/page/column_codec.h"
#include "surfeit/surfel.h"

namespace surfeit {

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
  // False when the columns end early, or hold what is no transparency.
  bool get(PayloadReader& reader) const {
    for (const auto& column : bytes) {
      if (!getBytes8(reader, column)) return false;
    }
    for (std::size_t i = 0; i < bytes[0].size(); ++i) {
      if (at(i) > kMostTransparency) return false;
    }
    return true;
  }
};

}  // namespace surfeit
