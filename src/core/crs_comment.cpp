#include "core/crs_comment.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <iterator>

namespace surfeit {
namespace {

constexpr std::size_t kMostChars = 60;  // of well-known text: its name stands in front

// Well-known text of longitudes and latitudes, and of others; a system's parts follow its own name.
constexpr std::string_view kGeographicText[] = {"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS",
                                                "GEODETICCRS"};
constexpr std::string_view kOtherText[] = {"PROJCS",   "PROJCRS",  "PROJECTEDCRS", "GEOCCS",
                                           "LOCAL_CS", "LOCALCRS", "ENGCRS",       "ENGINEERINGCRS",
                                           "VERT_CS",  "VERTCRS"};
// What maps and scans of longitudes and latitudes mostly have: systems of the world and of
// continents, in two and three dimensions. The numbers alone tell nothing: 4978 is geocentric.
constexpr std::uint32_t kGeographicCodes[] = {
    4326, 4979, 7661, 7663, 7665, 9056, 9057, 9754, 9755,  // WGS 84
    7912, 9000, 9989, 9990,                                // ITRF2014, ITRF2020
    4267, 4269, 4152, 4759, 6318, 6319, 4617, 4955,        // North America
    4258, 4937, 4230, 4277, 4289, 4313, 4314,              // Europe
    4612, 6668, 6697, 4490, 4480,                          // Japan, China
    4283, 4939, 7843, 7844, 4167, 4959, 4674, 4989};       // Oceania, South America

// Where the first of such texts begins; npos: none does.
template <typename Names>
std::size_t findFirst(std::string_view crs, const Names& names) {
  std::size_t first = crs.npos;
  for (const std::string_view name : names) {
    for (std::size_t at = crs.find(name); at != crs.npos; at = crs.find(name, at + 1)) {
      const std::size_t end = crs.find_first_not_of(' ', at + name.size());
      if (end == crs.npos || (crs[end] != '[' && crs[end] != '(')) continue;
      first = std::min(first, at);
      break;
    }
  }
  return first;
}

}  // namespace

bool isGeographicCrs(std::string_view crs) {
  // Well-known text
  const std::size_t geographic = findFirst(crs, kGeographicText);
  const std::size_t other = findFirst(crs, kOtherText);
  if (geographic < other) return crs.find("artesian", geographic) == crs.npos;
  if (other != crs.npos) return false;

  // A code, or keys of GeoTIFF
  std::uint32_t code = 0;
  const std::string_view digits = epsgCodeOf(crs);
  std::from_chars(digits.data(), digits.data() + digits.size(), code);
  if (code == kGeocentricCode) return false;
  if (crs.starts_with(kGeographicWord)) return true;
  return std::find(std::begin(kGeographicCodes), std::end(kGeographicCodes), code) !=
         std::end(kGeographicCodes);
}

std::string noteOfDegrees(std::string_view crs) {
  if (!isGeographicCrs(crs)) return {};
  return "x and y are degrees, not lengths as z is: the coordinate reference system is " +
         std::string(crs.substr(0, kMostChars)) +
         "; reproject the cloud first, for example by `pdal translate IN OUT -f "
         "filters.reprojection --filters.reprojection.out_srs=EPSG:CODE`, CODE being the code of "
         "the UTM zone";
}

}  // namespace surfeit
