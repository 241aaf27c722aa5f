// Units of length by the names that users and files have for them: `convert --units`, names of
// columns, coordinate reference systems.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string_view>

namespace surfeit {

struct LengthUnit {
  std::string_view option;  // as --units calls it
  std::string_view plural;  // in sentences
  double metres = 0;
  std::uint16_t epsg = 0;     // its code in coordinate reference systems; 0: none
  std::string_view synonyms;  // parted by blanks, in lower case
};

inline constexpr LengthUnit kLengthUnits[] = {
    {"m", "metres", 1, 9001, "metre metres meter meters"},
    {"cm", "centimetres", .01, 1033, "centimetre centimetres centimeter centimeters"},
    {"mm", "millimetres", .001, 1025, "millimetre millimetres millimeter millimeters"},
    {"km", "kilometres", 1000, 9036, "kilometre kilometres kilometer kilometers"},
    {"in", "inches", .0254, 0, "inch inches"},
    {"ft", "feet", .3048, 9002, "foot feet"},
    {"us-ft", "US survey feet", 1200. / 3937, 9003, "usft ftus us_ft sft"},
};

// The unit of that name, in any case; nullptr where it is none that we know.
inline const LengthUnit* findLengthUnit(std::string_view name) {
  const auto is_name = [name](std::string_view word) {
    return std::equal(word.begin(), word.end(), name.begin(), name.end(), [](char a, char b) {
      return a == (b >= 'A' && b <= 'Z' ? b - 'A' + 'a' : b);
    });
  };
  for (const LengthUnit& unit : kLengthUnits) {
    if (is_name(unit.option)) return &unit;
    for (std::string_view rest = unit.synonyms; !rest.empty();) {
      const std::string_view word = rest.substr(0, rest.find(' '));
      if (is_name(word)) return &unit;
      rest.remove_prefix(std::min(word.size() + 1, rest.size()));
    }
  }
  return nullptr;
}

// The unit of that code of EPSG, or nullptr.
inline const LengthUnit* lengthUnitOfEpsg(std::uint16_t code) {
  const auto* const found =
      std::find_if(std::begin(kLengthUnits), std::end(kLengthUnits),
                   [code](const LengthUnit& unit) { return code != 0 && unit.epsg == code; });
  return found == std::end(kLengthUnits) ? nullptr : found;
}

// The unit of so many metres, within what files round; nullptr where there is none.
inline const LengthUnit* lengthUnitOfMetres(double metres) {
  const auto* const found = std::find_if(
      std::begin(kLengthUnits), std::end(kLengthUnits), [metres](const LengthUnit& unit) {
        return std::abs(unit.metres - metres) <= 1e-9 * unit.metres;
      });
  return found == std::end(kLengthUnits) ? nullptr : found;
}

}  // namespace surfeit
