// Units of length that coordinate reference systems state.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace surfeit {

// A unit by its code (GeoTIFF, EPSG) or as text; metres is 0 where it is none that we know.
struct CrsUnit {
  std::string name;  // empty: not stated
  double metres = 0;
};

CrsUnit crsUnitOfCode(std::uint16_t code);
// Of a projected system by its code; most are in metres, and say nothing.
CrsUnit crsUnitOfProjected(std::uint16_t code);
// Of a vertical system by its code, where that tells it; most are in metres, and say nothing.
CrsUnit crsUnitOfHeights(std::uint16_t code);

// In front of the codes of units, in what GeoTIFF keys become: "EPSG:2992+5703 unit 9002".
inline constexpr std::string_view kUnitWords = " unit ", kVerticalUnitWords = " vertical unit ";
// The number behind `words` in such text; 0 where there is none.
std::uint16_t unitCodeIn(std::string_view text, std::string_view words);

// The units of lengths of a system: as its codes say, or in the order of well-known text, that of x
// and y, then that of heights. Where that states one, it is the first; angles are passed over.
struct CrsUnits {
  CrsUnit horizontal, vertical;
};
CrsUnits crsUnitsOfText(std::string_view text);

// One sentence where lengths are no metres, or heights have another unit than x and y, with the way
// out; else empty.
std::string noteOfCrsUnits(const CrsUnits& units);

}  // namespace surfeit
