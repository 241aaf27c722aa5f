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
// Of a vertical system by its code, where that tells it; most are in metres, and say nothing.
CrsUnit crsUnitOfHeights(std::uint16_t code);

// The units of lengths in well-known text, in its order: that of x and y, then that of heights.
// Where it states one, that is the first; angles are passed over.
struct CrsUnits {
  CrsUnit horizontal, vertical;
};
CrsUnits crsUnitsOfText(std::string_view text);

// One sentence where lengths are no metres, or heights have another unit than x and y, with the way
// out; else empty.
std::string noteOfCrsUnits(const CrsUnits& units);

}  // namespace surfeit
