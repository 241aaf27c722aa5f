#include "cloud/rows/crs_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include "cloud/rows/row_layout.h"
#include "surfeit/length_unit.h"

namespace surfeit {
namespace {

bool isSame(double a, double b) { return std::abs(a - b) <= 1e-9 * std::abs(b); }
bool isMetre(const CrsUnit& unit) { return unit.name.empty() || isSame(unit.metres, 1); }

// "ft", or a number of metres.
std::string optionOf(const CrsUnit& unit) {
  const LengthUnit* const known = lengthUnitOfMetres(unit.metres);
  return known != nullptr ? std::string(known->option) : fmt::format("{:.12g}", unit.metres);
}

}  // namespace

CrsUnit crsUnitOfCode(std::uint16_t code) {
  constexpr std::uint16_t kUserDefined = 32767;
  if (code == 0 || code == kUserDefined) return {};
  if (const LengthUnit* const known = lengthUnitOfEpsg(code)) {
    return {std::string(known->plural), known->metres};
  }
  return {fmt::format("unit {} of EPSG", code), 0};
}

CrsUnit crsUnitOfHeights(std::uint16_t code) {
  // NAVD88 and NGVD29 in feet
  constexpr std::uint16_t kFeet[] = {8228, 7968}, kSurveyFeet[] = {6360, 6358, 5702};
  const auto has = [code](const auto& codes) {
    return std::find(std::begin(codes), std::end(codes), code) != std::end(codes);
  };
  if (has(kFeet)) return crsUnitOfCode(9002);
  return has(kSurveyFeet) ? crsUnitOfCode(9003) : CrsUnit();
}

std::uint16_t unitCodeIn(std::string_view text, std::string_view words) {
  for (std::size_t at = text.find(words); at != text.npos; at = text.find(words, at + 1)) {
    const std::string_view before = text.substr(0, at);
    if (words == kUnitWords && (before.ends_with(" vertical") || before.ends_with(" angular"))) {
      continue;
    }
    std::uint16_t code = 0;
    const char* const end = text.data() + text.size();
    const auto [behind, error] = std::from_chars(text.data() + at + words.size(), end, code);
    if (error == std::errc() && (behind == end || *behind == ' ')) return code;
  }
  return 0;
}

namespace {

// "EPSG:2992+5703 vertical unit 9003 unit 9002"; what is stated goes before what codes mean.
CrsUnits crsUnitsOfKeys(std::string_view text) {
  constexpr std::string_view kEpsg = "EPSG:";
  const char* const end = text.data() + text.size();
  std::uint16_t code = 0, vertical_code = 0;
  if (text.starts_with(kEpsg)) {
    const char* const behind = std::from_chars(text.data() + kEpsg.size(), end, code).ptr;
    if (behind != end && *behind == '+') std::from_chars(behind + 1, end, vertical_code);
  }
  const std::uint16_t unit = unitCodeIn(text, kUnitWords);
  const std::uint16_t vertical_unit = unitCodeIn(text, kVerticalUnitWords);
  return {unit != 0 ? crsUnitOfCode(unit) : crsUnitOfProjected(code),
          vertical_unit != 0 ? crsUnitOfCode(vertical_unit) : crsUnitOfHeights(vertical_code)};
}

}  // namespace

// [LENGTH]UNIT["name", metres, ...]
CrsUnits crsUnitsOfText(std::string_view text) {
  if (text.find('[') == text.npos) return crsUnitsOfKeys(text);
  CrsUnits units;
  constexpr std::string_view kWord = "UNIT[\"";
  for (std::size_t at = text.find(kWord); at != text.npos; at = text.find(kWord, at + 1)) {
    const std::size_t begin = at + kWord.size(), end = text.find('"', begin);
    if (end == text.npos) break;
    const std::size_t number = text.find_first_of("0123456789.", end);
    double metres = 0;
    if (number != text.npos && text.find_first_not_of(", ", end + 1) == number) {
      std::from_chars(text.data() + number, text.data() + text.size(), metres);
    }
    const std::string name(text.substr(begin, end - begin));
    const bool is_of_length = text.substr(0, at).ends_with("LENGTH");
    const bool is_plain = at == 0 || text[at - 1] == ',' || text[at - 1] == ' ';
    const bool is_angle = name.starts_with("deg") || name.starts_with("Deg") ||
                          name.starts_with("rad") || name.starts_with("Rad") ||
                          name.starts_with("grad") || name.starts_with("unity");
    if ((!is_of_length && !is_plain) || is_angle) continue;
    CrsUnit& unit = units.horizontal.name.empty() ? units.horizontal : units.vertical;
    unit = {name, metres};
  }
  return units;
}

std::string noteOfCrsUnits(const CrsUnits& units) {
  const CrsUnit &places = units.horizontal, &heights = units.vertical;
  const bool are_alike = heights.name.empty() || places.name.empty()
                             ? isMetre(heights)
                             : heights.name == places.name || isSame(heights.metres, places.metres);
  if (are_alike && isMetre(places)) return {};
  if (are_alike) {
    return fmt::format(
        "positions are in {}, as the coordinate reference system says, and stay so{}",
        quoteText(places.name),
        places.metres > 0 ? fmt::format(": convert --units {}:m scales them", optionOf(places))
                          : "");
  }
  const double metres = places.name.empty() ? 1 : places.metres;
  const std::string advice =
      heights.metres > 0 && metres > 0
          ? fmt::format(": convert --set \"z *= {:.9g}\" makes {} of heights",
                        heights.metres / metres,
                        places.name.empty() ? "metres" : "the unit of x and y")
          : std::string();
  return fmt::format(
      "heights are in {}, as the coordinate reference system says, x and y in {}, and all stay "
      "so{}",
      quoteText(heights.name.empty() ? "metres" : heights.name),
      places.name.empty() ? "the unit of its code" : quoteText(places.name), advice);
}

}  // namespace surfeit
