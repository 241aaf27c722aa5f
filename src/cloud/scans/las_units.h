// Units of length that the coordinate reference system of a LAS file states.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace surfeit {

// A unit by its code (GeoTIFF, EPSG) or as text; metres is 0 where it is none that we know.
struct LasUnit {
  std::string name;  // empty: not stated
  double metres = 0;
};

LasUnit lasUnitOfCode(std::uint16_t code);

// The units of lengths in well-known text, in its order: that of x and y, then that of heights.
// Where it states one, that is the first; angles are passed over.
struct LasUnits {
  LasUnit horizontal, vertical;
};
LasUnits lasUnitsOfText(std::string_view text);

// One sentence where lengths are no metres, or heights have another unit than x and y, with the way
// out; else empty.
std::string noteOfLasUnits(const LasUnits& units);

}  // namespace surfeit
