#include "core/crs_comment.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>

namespace surfeit {
namespace {

constexpr std::string_view kReproject =
    "; reproject the cloud first, for example by `pdal translate IN OUT -f filters.reprojection "
    "--filters.reprojection.out_srs=EPSG:CODE`, CODE being the code of the UTM zone";
// How many times as high as wide, and as far from 0, clouds of degrees are.
constexpr double kThin = 1000, kHigh = 20, kFar = 100;
constexpr double kLeastHeight = -1000, kMostHeight = 10000;  // of places on Earth, in metres
constexpr std::size_t kMostChars = 60;  // of well-known text: its name stands in front

// Well-known text of longitudes and latitudes, and of others; a system's parts follow its own name.
constexpr std::string_view kGeographicText[] = {"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS",
                                                "GEODETICCRS"};
constexpr std::string_view kGeocentricText[] = {"GEOCCS"};
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

std::uint16_t angularUnitOf(std::string_view crs) {
  const std::size_t at = crs.find(kAngularUnitWords);
  std::uint16_t code = 0;
  if (at == crs.npos) return code;
  const std::string_view digits = crs.substr(at + kAngularUnitWords.size());
  std::from_chars(digits.data(), digits.data() + digits.size(), code);
  return code;
}

std::string noteOfDegrees(std::string_view crs) {
  if (!isGeographicCrs(crs)) return {};
  const std::uint16_t unit = angularUnitOf(crs);
  const std::string angles = unit == 0                      ? "degrees"
                             : unit == 9101                 ? "radians"
                             : unit == 9105 || unit == 9106 ? "gons"
                                                            : "angles";
  return "x and y are " + angles + ", not lengths as z is: the coordinate reference system is " +
         std::string(crs.substr(0, kMostChars)) + std::string(kReproject);
}

std::string noteOfGeocentric(std::string_view crs) {
  if (!crs.starts_with(kGeocentricWord) && findFirst(crs, kGeocentricText) == crs.npos) return {};
  return "x, y and z are counted from the centre of the Earth, so that none of them is up: the "
         "coordinate reference system is " +
         std::string(crs.substr(0, kMostChars)) + std::string(kReproject);
}

std::string noteOfLikelyDegrees(const Bounds3d& bounds) {
  if (bounds.isEmpty()) return {};
  const glm::dvec3 low = bounds.min, high = bounds.max;
  const bool may_be = low.x >= -180 && high.x <= 180 && low.y >= -90 && high.y <= 90 &&
                      low.z >= kLeastHeight && high.z <= kMostHeight;
  const double width = std::max(high.x - low.x, high.y - low.y);
  const double height = high.z - low.z;
  const double distance = std::max(std::abs(low.x), std::abs(low.y));
  // A pole is high, too, but mostly stands near 0
  const bool is_thin = height > kThin * width;
  const bool is_far = height > kHigh * width && distance > kFar * width;
  if (!may_be || width <= 0 || (!is_thin && !is_far)) return {};
  return "x and y look like longitudes and latitudes in degrees, not lengths as z is: they lie "
         "within 180 and 90 of 0, and heights are far larger than the cloud is wide" +
         std::string(kReproject);
}

}  // namespace surfeit
