#include "cloud/text/xyz_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "cloud/text/text_rows.h"
#include "surfeit/length_unit.h"

namespace surfeit {
namespace {

constexpr std::string_view kPlaces[] = {"x", "y", "z"};
constexpr std::string_view kLengths[] = {"radius", "pscale", "width"};

std::string lowerOf(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

// Metres; 0 where the unit is none that we know.
double metresOf(std::string_view unit) {
  const LengthUnit* const known = findLengthUnit(unit);
  return known == nullptr ? 0 : known->metres;
}

// Of an area: m2, mm^2, "sq ft".
double squareMetresOf(std::string_view unit) {
  std::string_view root = unit;
  for (const std::string_view power : {"\xC2\xB2", "2", "^"}) {
    if (root.ends_with(power)) root.remove_suffix(power.size());
  }
  if (root.size() == unit.size() && lowerOf(root).starts_with("sq ")) root.remove_prefix(3);
  const double metres = root.size() == unit.size() ? 0 : metresOf(root);
  return metres * metres;
}

bool isIn(std::span<const std::string_view> words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

struct Length {  // a column
  std::string name;
  std::string unit;
  double metres = 0;  // to the power of its dimension
  int dimension = 1;
};

// The columns that are lengths and have a unit, places first.
std::vector<Length> lengthsOf(std::span<const std::string> names,
                              std::span<const std::string> file_names) {
  std::vector<Length> places, sizes;
  for (std::size_t i = 0; i < names.size() && i < file_names.size(); ++i) {
    const std::string unit(splitUnit(file_names[i]).unit);
    if (unit.empty()) continue;
    if (isIn(kPlaces, names[i])) {
      places.push_back({names[i], unit, metresOf(unit), 1});
    } else if (isIn(kLengths, names[i])) {
      sizes.push_back({names[i], unit, metresOf(unit), 1});
    } else if (names[i] == "area") {
      sizes.push_back({names[i], unit, squareMetresOf(unit), 2});
    }
  }
  places.insert(places.end(), sizes.begin(), sizes.end());
  return places;
}

}  // namespace

bool isKnownUnit(std::string_view unit) { return metresOf(unit) > 0 || isAngularUnit(unit); }

bool isAngularUnit(std::string_view unit) {
  constexpr std::string_view kAngles[] = {"deg", "degree", "degrees", "\xC2\xB0",
                                          "rad", "radian", "radians", "dd"};
  return isIn(kAngles, lowerOf(unit));
}

bool hasAngles(std::string_view line) {
  // Of UTF-8, and of Latin-1 where no UTF-8 is
  for (std::size_t at = 1; at < line.size(); ++at) {
    const bool is_behind_digit = std::isdigit(static_cast<unsigned char>(line[at - 1])) != 0;
    const std::string_view rest = line.substr(at);
    const bool is_degree = rest.starts_with("\xC2\xB0") || rest.starts_with("\xC2\xBA") ||
                           rest[0] == '\xB0' || rest[0] == '\xBA';
    if (is_behind_digit && is_degree) return true;
  }
  // Of words: digits, a sign, digits, a sign, and so on; or a number and a letter
  std::size_t angles = 0, east = 0, north = 0;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t end = std::min(line.find_first_of(" ,;\t|", at), line.size());
    std::string_view word = line.substr(at, end - at);
    at = end + 1;
    if (word.empty()) continue;
    const char last = word.back();
    const bool is_compass = last == 'E' || last == 'W' || last == 'N' || last == 'S';
    if (is_compass) {
      (last == 'E' || last == 'W' ? east : north) += 1;
      word.remove_suffix(1);
      if (word.empty()) continue;
    }
    std::size_t signs = 0;
    bool has_degrees = false;  // 2'600'000 is a number with thousands
    bool is_angle = std::isdigit(static_cast<unsigned char>(word.front())) != 0 ||
                    word.front() == '-' || word.front() == '+';
    for (const char c : word.substr(std::min<std::size_t>(1, word.size()))) {
      const bool is_sign = std::string_view("dms:'\"").find(c) != std::string_view::npos;
      signs += is_sign ? 1 : 0;
      has_degrees = has_degrees || c == 'd' || c == ':';
      is_angle = is_angle && (is_sign || c == '.' || std::isdigit(static_cast<unsigned char>(c)));
    }
    if (is_compass && !is_angle) return false;  // words
    angles += is_angle && signs >= 2 && has_degrees ? 1 : 0;
  }
  return angles >= 2 || (east == 1 && north == 1);
}

NameWithUnit splitUnit(std::string_view word) {
  word = trimmedLine(word);
  const std::size_t bracket = word.find_first_of("([");
  const bool has_brackets = bracket != word.npos && bracket > 0 && bracket + 1 < word.size() &&
                            (word.back() == ')' || word.back() == ']');
  if (has_brackets) {
    return {trimmedLine(word.substr(0, bracket)),
            trimmedLine(word.substr(bracket + 1, word.size() - bracket - 2))};
  }
  const std::size_t line = word.find_last_of("_/");
  if (line == word.npos || line == 0) return {word, {}};
  const std::string_view unit = word.substr(line + 1);
  constexpr std::string_view kNames[] = {"x",      "y",      "z",     "easting",  "northing",
                                         "height", "radius", "width", "elevation"};
  if (metresOf(unit) == 0 || !isIn(kNames, lowerOf(word.substr(0, line)))) return {word, {}};
  return {word.substr(0, line), unit};
}

std::string noteOfUnits(std::span<const std::string> names,
                        std::span<const std::string> file_names) {
  const std::vector<Length> lengths = lengthsOf(names, file_names);
  if (lengths.empty()) return {};
  const double unit = lengths[0].metres;
  std::string all, scales;
  bool are_alike = true;
  for (const Length& length : lengths) {
    all += fmt::format("{}{} in {}", all.empty() ? "" : ", ", length.name, quoteText(length.unit));
    const bool is_alike = unit > 0 && length.metres == (length.dimension == 2 ? unit * unit : unit);
    const bool is_same_word = length.unit == lengths[0].unit && length.dimension == 1;
    are_alike = are_alike && (is_alike || is_same_word);
    if (is_alike || is_same_word || unit == 0 || length.metres == 0) continue;
    const double factor = length.metres / (length.dimension == 2 ? unit * unit : unit);
    scales += fmt::format(" --set \"{} *= {:.9g}\"", length.name, factor);
  }
  if (!are_alike) {
    return fmt::format(
        "columns have several units, as their names say, and numbers stay as they are: {}; {}", all,
        scales.empty() ? std::string("give them one unit")
                       : fmt::format("convert{} makes one unit of them", scales));
  }
  if (unit == 1) return {};
  const LengthUnit* const known = findLengthUnit(lengths[0].unit);
  return fmt::format(
      "places are in {}, as the names of columns say, and stay so: convert --units{} scales them",
      quoteText(lowerOf(lengths[0].unit)),
      known == nullptr ? "" : fmt::format(" {}:m", known->option));
}

}  // namespace surfeit
