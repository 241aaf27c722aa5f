// What the columns of a text of points are: a file without a header says nothing about itself, so
// names and types follow from the values of all its rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/text/text_rows.h"
#include "surfeit/status.h"

namespace surfeit {

// The values of one column in all rows; of none, when it has words that are no numbers.
struct XyzColumn {
  bool are_numbers = true;
  bool are_floats = true;     // floats, written with as many decimals, give all of them back
  bool are_wholes = true;     // 235 and 235.0
  bool counts_rows = true;    // each is one more than that of the row before
  std::uint64_t missing = 0;  // rows whose cell has no value
  std::uint64_t rounded = 0;  // rows with a whole number that no double holds
  double least = std::numeric_limits<double>::infinity();
  double largest = -std::numeric_limits<double>::infinity();

  bool isConstant() const { return least == largest; }
};

struct XyzTable {
  std::uint64_t row_count = 0;
  std::vector<XyzColumn> columns;
  // Whether columns i, i + 1 and i + 2 are vectors of unit length within 1 %, zero aside
  std::vector<bool> are_unit_vectors;
  // Lines of one whole number: the counts of scans
  std::uint64_t scan_count = 0;
  std::uint64_t commented_rows = 0;  // with a comment behind the values
  std::uint64_t colored_rows = 0;    // with one that looks like a color: #ff8800
  std::uint64_t comment_lines = 0;   // among rows or behind them
  std::string count_note;            // of the first count that is not that of the rows behind it
  // The first line that is not as the columns say: what to answer, and whether it has a comma
  Status refusal;
  bool has_comma_in_refused = false;
};

// Reads all rows from here on, up to the first line that is not one. `columns` have names for
// messages; words of those that are not kept may be anything. `pts_count` is the count in front of
// the rows, when extras has counts.
Result<XyzTable> scanXyz(LineSource& source, std::span<const TextColumn> columns, TextExtras extras,
                         std::uint64_t pts_count);

// Surveys number their points: 1 x y z, and robots stamp them with a time. kCorruption, with both
// readings, when the first of four columns or more may be so.
Status checkFirstXyzColumn(const XyzTable& table);

// Names of columns that no header names: x y z, then from left to right
//   three that are unit vectors in all rows                            nx ny nz, once
//   three between those and the ends that are colors                   red green blue, once
//   four of them: colors and alpha, or intensity and colors, as in PTS
//   all others                                                         intensity right after x y z,
//                                                                      else scalar, scalar_2, ...
// Colors are whole numbers up to 65535, values up to 1, or reals up to 255. kCorruption when
// values allow several readings, which the message has, and as checkFirstXyzColumn. At
// least three columns.
Result<std::vector<std::string>> nameXyzColumns(const XyzTable& table, bool is_pts);

// Types of the columns. x y z are floats when floats give all rows back, else doubles; so are all
// others, one by one. Whole numbers in all rows make colors uchar (up to 255, at least one above 1)
// or ushort (up to 65535), groups and two_sided uchar.
std::vector<ValueType> typeXyzColumns(const XyzTable& table, std::span<const std::string> names);

}  // namespace surfeit
