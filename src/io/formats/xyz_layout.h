// What the columns of a text of points are: a file without a header says nothing about itself, so
// names and types follow from its first rows, and from all rows where a row may change them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/formats/text_rows.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::size_t kMaxXyzColumns = 256;

// Names of the columns when the line, or the comment, names x, y and z; else empty. Quotes around
// names are taken off, case is ours for names that we know, r g b are red green blue, and a name
// that comes again gets a number.
std::vector<std::string> xyzHeaderNames(std::string_view line);

// Whether a word is a number.
bool isXyzNumber(std::string_view word);

// The values of one column in the first rows.
struct XyzColumn {
  std::vector<double> values;
  bool are_floats = true;  // floats, written with as many decimals, give all of them back
  bool are_wholes = true;  // digits only
};
// Those of the first rows, as far as they have as many words as the first of them; at most 1000.
std::vector<XyzColumn> sampleXyz(std::string_view lines);

// Names of columns that no header names:
//   x y z, then from left to right
//   three that are unit vectors, within 1 % in all rows (zero aside)   nx ny nz
//   three that are whole numbers up to 255, or the last three          red green blue
//   one                                                                intensity right after x y z,
//                                                                      else scalar, scalar_2, ...
// except that four columns whose last three are such whole numbers are intensity red green blue, as
// in PTS. At least three columns.
std::vector<std::string> nameXyzColumns(std::span<const XyzColumn> sample);

// What all rows tell.
struct XyzScan {
  std::uint64_t row_count = 0;
  // For every column asked for: whether all values are whole numbers, and the largest of them
  struct Column {
    std::size_t column = 0;
    bool are_wholes = true;
    std::uint64_t largest = 0;
  };
  std::vector<Column> columns;
};
// Reads on to the end of the file. `columns` ascend.
Result<XyzScan> scanXyz(LineSource& source, std::span<const std::size_t> columns);

// Columns whose types depend on all rows: whole numbers in the sample, x y z aside.
std::vector<std::size_t> wholeColumns(std::span<const XyzColumn> sample,
                                      std::span<const std::string> names);

// Types of the columns. x y z are floats when floats give the first rows back, else doubles; so are
// all others, one by one. Whole numbers in all rows make red green blue uchar (up to 255, at least
// one above 1) or ushort (up to 65535), groups and two_sided uchar; elsewhere doubles when they are
// above 2^24.
std::vector<PlyType> typeXyzColumns(std::span<const XyzColumn> sample,
                                    std::span<const std::string> names, const XyzScan& scan);

}  // namespace surfeit
