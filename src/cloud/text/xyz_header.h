// Lines that name the columns of a text of points: "x y z nx ny nz", "//X,Y,Z,Scalar field",
// "Easting;Northing;Elevation", "Points:0","Points:1","Points:2".
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace surfeit {

inline constexpr std::size_t kMaxXyzColumns = 256;

// Whether a column is one of a position.
constexpr bool isPlaceName(std::string_view name) {
  return name == "x" || name == "y" || name == "z";
}

struct XyzHeader {
  // Of the columns, as rows have them; empty when the line does not name a position.
  std::vector<std::string> names;
  // As the file has them, without quotes.
  std::vector<std::string> file_names;
  // What is to be told of units behind names, and of names that stand over several columns; empty
  // where there are none.
  std::string unit_note, repeat_note;
  std::string comment;  // behind the names
  // Why a line that names columns cannot be used; empty when it can.
  std::string refusal;
};

// Names of the columns when the line, a comment or not, names a position: x y z, easting northing
// elevation (e n h), points:0 points:1 points:2. Names are parted by semicolons, tabs or commas,
// and may have blanks then; else by blanks. Of several ways the one that gives `column_count` names
// is taken, if any. Quotes around names, units behind them (cloud/text/xyz_units.h) and a comment
// behind all are taken off; names that we know are ours in any case (r g b are red green blue); of
// colors that come again those that stand together are the color; any other name that comes again
// gets a number.
// Latitude and longitude are refused: they are angles.
XyzHeader parseXyzHeader(std::string_view line, std::size_t column_count = 0);

// Takes a line below the names that has a unit for each of them: "m m m", "[ft],[ft],[ft],-".
// Nothing happens, and false is returned, unless all of x, y and z have units that we know there.
bool addUnits(std::string_view line, XyzHeader& header);

}  // namespace surfeit
