// Numbers of rows that become others at the same place: codes of colors, directions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/rows/row_layout.h"

namespace surfeit {

// The bits of the nan that texts and most programs have. As a packed color they are none: black, as
// all other nan (alpha 255, red 128 or more) are colors.
inline constexpr std::uint32_t kNoPackedColor = 0x7fc00000;

// What is done to the numbers of a property. They become others at the same place of a row.
struct NumberChange {
  enum class Kind {
    kCode8,         // a whole number up to 255 becomes uchar
    kCode16,        // up to white: ushort, whose white is 65535
    kLight,         // a code becomes scene-linear
    kDirection,     // uchar and ushort become numbers on both sides of 0
    kFlag,          // all but 0 become 255 in a uchar
    kPackedNumber,  // three codes in a whole number
    kPackedBits     // or in the bits of an integer or float
  };
  Kind kind = Kind::kCode8;
  RowProperty property;       // as the file has it
  bool takes_larger = false;  // as the largest code, instead of refusing them
  double white = 255;         // the largest code
};

// Changes the property in `count` rows. Returns the number of rows done: less than `count` when the
// next one's value is no code.
std::size_t changeNumbers(const NumberChange& change, std::byte* rows, std::size_t count,
                          std::size_t row_bytes);

}  // namespace surfeit
