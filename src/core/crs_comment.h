// The coordinate reference system among the comments of a cloud: "crs EPSG:32610", or "crs " and
// well-known text.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/bounds.h"

namespace surfeit {

inline constexpr std::string_view kCrsComment = "crs ";
// In front of what GeoTIFF keys of a system of degrees tell, and of one about the Earth's centre.
inline constexpr std::string_view kGeographicWord = "geographic ";
inline constexpr std::string_view kGeocentricWord = "geocentric ";
inline constexpr unsigned kGeocentricCode = 4978;  // of WGS 84

// What the first comment of that form says; empty when none does.
inline std::string_view statedCrs(std::span<const std::string> comments) {
  for (const std::string& comment : comments) {
    if (comment.starts_with(kCrsComment)) {
      return std::string_view(comment).substr(kCrsComment.size());
    }
  }
  return {};
}

// The digits of the EPSG code; empty where there is none. Well-known text names those of its parts
// before its own.
inline std::string_view epsgCodeOf(std::string_view crs) {
  constexpr std::string_view kDigits = "0123456789";
  const std::size_t name = crs.rfind("EPSG");
  if (name == crs.npos) return {};
  const std::size_t begin = crs.find_first_of(kDigits, name);
  if (begin == crs.npos) return {};
  return crs.substr(begin, crs.find_first_not_of(kDigits, begin) - begin);
}

// Whether x and y are longitudes and latitudes in degrees, as far as the text tells.
bool isGeographicCrs(std::string_view crs);

// In front of the code of angles that are no degrees.
inline constexpr std::string_view kAngularUnitWords = " angular unit ";
// That code; 0: degrees, or not said.
std::uint16_t angularUnitOf(std::string_view crs);

// What is to be told of such a system, with the way out; empty for others.
std::string noteOfDegrees(std::string_view crs);

// What is to be told of a system about the Earth's centre; empty for others.
std::string noteOfGeocentric(std::string_view crs);

// What is to be told of a cloud that states no system, by the box of its places but for strays:
// within 180 and 90 of 0, and far higher than wide, though not above the highest mountains.
std::string noteOfLikelyDegrees(const Bounds3d& bounds);

// Whether two systems are one, as far as their texts tell: text and keys of one system differ.
inline bool isSameCrs(std::string_view a, std::string_view b) {
  return a == b || (!epsgCodeOf(a).empty() && epsgCodeOf(a) == epsgCodeOf(b));
}

}  // namespace surfeit
