// Units behind the names of columns: "x [m]", "radius (mm)", "Y_ft", "z/mm".
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace surfeit {

// A name as a file has it, without blanks around it, and the unit behind it: in brackets, or a
// length behind a line below or a stroke (x_mm, x/mm).
struct NameWithUnit {
  std::string_view name, unit;  // the unit without brackets; empty where there is none
};
NameWithUnit splitUnit(std::string_view word);

// Whether it is a unit of length or angle that we know.
bool isKnownUnit(std::string_view unit);
bool isAngularUnit(std::string_view unit);

// Whether a line has angles in degrees, minutes and seconds (7°30'12", 7d30m12s, 7:30:12), or
// numbers with a point of the compass (7.5E, 46 30 12 N).
bool hasAngles(std::string_view line);

// What the units of lengths mean, one sentence: numbers stay as the file has them. Empty where all
// are metres or nothing is said. `names` are ours, `file_names` those of the file, column by
// column.
std::string noteOfUnits(std::span<const std::string> names,
                        std::span<const std::string> file_names);

}  // namespace surfeit
