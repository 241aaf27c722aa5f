#include "cloud/text/xyz_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <iterator>

#include "cloud/parts/property_renames.h"
#include "cloud/rows/row_layout.h"
#include "cloud/text/text_rows.h"
#include "cloud/text/xyz_units.h"

namespace surfeit {
namespace {

constexpr std::size_t kMaxNameChars = 56;

// What files call columns that we know, in lower case. Of several names of one, the first counts.
struct Alias {
  std::string_view alias, name;
};
constexpr Alias kAliases[] = {
    {"x", "x"},
    {"y", "y"},
    {"z", "z"},
    {"points:0", "x"},
    {"points:1", "y"},
    {"points:2", "z"},
    {"points_0", "x"},
    {"points_1", "y"},
    {"points_2", "z"},
    {"position_x", "x"},
    {"position_y", "y"},
    {"position_z", "z"},
    {"pos_x", "x"},
    {"pos_y", "y"},
    {"pos_z", "z"},
    {"x coordinate", "x"},
    {"y coordinate", "y"},
    {"z coordinate", "z"},
    {"x_coordinate", "x"},
    {"y_coordinate", "y"},
    {"z_coordinate", "z"},
    {"x_coord", "x"},
    {"y_coord", "y"},
    {"z_coord", "z"},
    {"coord_x", "x"},
    {"coord_y", "y"},
    {"coord_z", "z"},
    {"xcoord", "x"},
    {"ycoord", "y"},
    {"zcoord", "z"},
    {"point_x", "x"},
    {"point_y", "y"},
    {"point_z", "z"},
    {"utm_x", "x"},
    {"utm_y", "y"},
    {"rechtswert", "x"},
    {"hochwert", "y"},
    {"easting", "x"},
    {"northing", "y"},
    {"eastings", "x"},
    {"northings", "y"},
    {"east", "x"},
    {"north", "y"},
    {"e", "x"},
    {"n", "y"},
    {"elevation", "z"},
    {"elev", "z"},
    {"height", "z"},
    {"altitude", "z"},
    {"alt", "z"},
    {"h", "z"},
    {"hoehe", "z"},
    {"h\xC3\xB6he", "z"},
    {"h\xF6he", "z"},
    {"red", "red"},
    {"green", "green"},
    {"blue", "blue"},
    {"r", "red"},
    {"g", "green"},
    {"b", "blue"},
    {"rf", "red"},
    {"gf", "green"},
    {"bf", "blue"},
    {"rgb:0", "red"},
    {"rgb:1", "green"},
    {"rgb:2", "blue"},
    {"rgba:0", "red"},
    {"rgba:1", "green"},
    {"rgba:2", "blue"},
    {"colors:0", "red"},
    {"colors:1", "green"},
    {"colors:2", "blue"},
    {"color:0", "red"},
    {"color:1", "green"},
    {"color:2", "blue"},
    {"alpha", "alpha"},
    {"a", "alpha"},
    {"af", "alpha"},
    {"rgba:3", "alpha"},
    {"colors:3", "alpha"},
    {"color:3", "alpha"},
    {"nx", "nx"},
    {"ny", "ny"},
    {"nz", "nz"},
    {"normal_x", "nx"},
    {"normal_y", "ny"},
    {"normal_z", "nz"},
    {"normal x", "nx"},
    {"normal y", "ny"},
    {"normal z", "nz"},
    {"normalx", "nx"},
    {"normaly", "ny"},
    {"normalz", "nz"},
    {"normals:0", "nx"},
    {"normals:1", "ny"},
    {"normals:2", "nz"},
    {"normals_0", "nx"},
    {"normals_1", "ny"},
    {"normals_2", "nz"},
    {"normal:0", "nx"},
    {"normal:1", "ny"},
    {"normal:2", "nz"},
    {"intensity", "intensity"},
    {"i", "intensity"},
    {"radius", "radius"},
    {"area", "area"},
    {"width", "width"},
    {"pscale", "pscale"},
    {"group", "group"},
};
// A letter alone means what we think only beside its fellows.
constexpr std::string_view kFellows[] = {"r g b", "e n"};

constexpr std::string_view kLatitudes[] = {"lat", "latitude", "lat_deg", "phi"};
constexpr std::string_view kLongitudes[] = {"lon", "long", "lng", "longitude", "lon_deg", "lambda"};

constexpr std::string_view kAroundUnits = " []()\"'";

using Words = std::vector<std::string>;

bool contains(const Words& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

template <std::size_t kCount>
bool containsAny(const Words& words, const std::string_view (&names)[kCount]) {
  return std::any_of(std::begin(names), std::end(names),
                     [&](std::string_view name) { return contains(words, name); });
}

constexpr std::string_view kAngles =
    ", which are angles, expected lengths: project the points first, to UTM for example";

// Why x and y cannot be used that have units of angles; empty where they have none.
std::string refusalOfAngles(const Words& names, const Words& file_names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string_view unit = splitUnit(file_names[i]).unit;
    if (!isPlaceName(names[i]) || !isAngularUnit(unit)) continue;
    return fmt::format("found {} in {}{}", names[i], quoteText(unit), kAngles);
  }
  return {};
}

// The words between separators outside quotes; a blank stands for any number of blanks with at most
// one comma among them.
Words split(std::string_view line, char separator) {
  Words words;
  std::string word;
  bool is_quoted = false, had_quotes = false;
  const auto end_word = [&](bool is_kept) {
    const std::string_view text = had_quotes ? std::string_view(word) : trimmedLine(word);
    if (is_kept || !text.empty() || had_quotes) words.emplace_back(text);
    word.clear();
    had_quotes = false;
  };
  for (const char c : line) {
    if (c == '"') {
      is_quoted = !is_quoted;
      had_quotes = true;
      if (is_quoted) word.clear();
    } else if (!is_quoted &&
               (separator == ' ' ? isTextBlank(c) || isTextComma(c) : c == separator)) {
      end_word(separator != ' ');
    } else if (!had_quotes || is_quoted) {
      word += c;
    }
    if (words.size() > kMaxXyzColumns) return {};
  }
  end_word(false);  // a separator may end the line
  return words;
}

std::string inLowerCase(std::string_view word) {
  std::string text(word);
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// In lower case, without a unit.
std::string plainName(std::string_view word) { return inLowerCase(splitUnit(word).name); }

// Brackets behind a blank are part of the name before: x [m] y [m].
Words withUnits(Words words) {
  Words joined;
  bool is_open = false;
  for (std::string& word : words) {
    const bool begins = !word.empty() && (word[0] == '[' || word[0] == '(');
    if ((begins || is_open) && !joined.empty()) {
      joined.back() += ' ' + word;
      is_open = word.find_first_of(")]") == word.npos;
    } else {
      joined.push_back(std::move(word));
    }
  }
  return is_open ? Words() : joined;
}

// The letters of the file made fit for a property.
std::string fitName(std::string_view word) {
  std::string name(word.substr(0, kMaxNameChars));
  std::replace_if(
      name.begin(), name.end(),
      [](char c) { return !(c > ' ' && c < '\x7f') || c == ':' || isTextComma(c); }, '_');
  return name.empty() ? "_" : name;
}

bool hasFellows(std::string_view letter, const Words& plain) {
  for (const std::string_view fellows : kFellows) {
    if (letter.size() != 1 || fellows.find(letter) == fellows.npos) continue;
    const Words needed = split(fellows, ' ');
    return std::all_of(needed.begin(), needed.end(),
                       [&](const std::string& word) { return contains(plain, word); });
  }
  return true;
}

// Of names that come twice those that stand together are the color: A B C R G B. `names` has the
// first of each.
void chooseColors(const Words& plain, Words& names) {
  constexpr std::string_view kColors[] = {"red", "green", "blue"};
  std::array<std::string, 3> aliases;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto found = std::find(names.begin(), names.end(), kColors[i]);
    if (found == names.end()) return;
    aliases[i] = plain[static_cast<std::size_t>(found - names.begin())];
  }
  // In this order before any other
  const auto begin = std::search(plain.begin(), plain.end(), aliases.begin(), aliases.end());
  auto at = begin;
  for (at = begin == plain.end() ? plain.begin() : begin; plain.end() - at >= 3; ++at) {
    if (std::is_permutation(aliases.begin(), aliases.end(), at)) break;
  }
  if (plain.end() - at < 3) return;
  for (std::string& name : names) {
    if (std::find(std::begin(kColors), std::end(kColors), name) != std::end(kColors)) name.clear();
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const auto found = std::find(at, plain.end(), aliases[i]);
    names[static_cast<std::size_t>(found - plain.begin())] = kColors[i];
  }
}

// An a is alpha beside the color.
bool isBesideColor(const Words& names, std::size_t column) {
  const auto is_color = [&](std::size_t i) {
    return i < names.size() && (names[i] == "red" || names[i] == "green" || names[i] == "blue");
  };
  return is_color(column + 1) || (column > 0 && is_color(column - 1));
}

// Tells of names that stand over several columns, and what these are.
std::string noteOfRepeats(const Words& words, const Words& names) {
  std::string repeats;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (std::count(words.begin(), words.end(), words[i]) == 1) continue;
    repeats += fmt::format("{}column {} ({}) is {}", repeats.empty() ? "" : ", ", i + 1,
                           quoteText(words[i]), names[i]);
  }
  if (repeats.empty()) return {};
  return fmt::format(
      "names stand over several columns: {}; --channels NUMBER=NAME names them "
      "otherwise, NUMBER=- drops them",
      repeats);
}

XyzHeader headerOf(Words words) {
  Words plain;
  for (const std::string& word : words) plain.push_back(plainName(word));
  // Beside an x, an X is another column
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] != plain[i] && contains(words, plain[i])) plain[i] = words[i];
  }

  // Names that we know
  Words names(words.size());
  for (const Alias& row : kAliases) {
    if (row.alias == "alpha") chooseColors(plain, names);  // all colors have theirs
    const auto found = std::find(plain.begin(), plain.end(), row.alias);
    if (found == plain.end() || contains(names, row.name)) continue;
    const auto column = static_cast<std::size_t>(found - plain.begin());
    if (row.alias == "a" && !isBesideColor(names, column)) continue;
    std::string& name = names[column];
    if (name.empty() && hasFellows(row.alias, plain)) name = row.name;
  }
  XyzHeader header;
  for (const std::string_view place : {"x", "y", "z"}) {
    if (std::count(plain.begin(), plain.end(), place) > 1) return {};
    if (contains(names, place)) continue;
    // Without x or y: angles, if they are named
    if (containsAny(plain, kLatitudes) && containsAny(plain, kLongitudes)) {
      header.refusal = "found latitude and longitude" + std::string(kAngles);
      header.file_names = std::move(words);
    }
    return header;
  }

  // All others
  DistinctNames distinct;
  for (const std::string& name : names) {
    if (!name.empty()) distinct.add(name);
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) names[i] = distinct.add(fitName(words[i]));
  }
  header.refusal = refusalOfAngles(names, words);
  header.unit_note = noteOfUnits(names, words);
  header.repeat_note = noteOfRepeats(words, names);
  header.names = std::move(names);
  header.file_names = std::move(words);
  return header;
}

}  // namespace

XyzHeader parseXyzHeader(std::string_view line, std::size_t column_count) {
  line = trimmedLine(line);
  while (line.starts_with('#') || line.starts_with('%') || line.starts_with('/'))
    line.remove_prefix(1);
  line = trimmedLine(line);
  XyzHeader best;
  for (const char separator : {';', '\t', ',', '|', ' '}) {
    if (separator != ' ' && line.find(separator) == line.npos) continue;
    Words words = split(line, separator);
    if (separator == ' ') words = withUnits(std::move(words));
    if (words.size() > kMaxXyzColumns) continue;
    XyzHeader header = headerOf(std::move(words));
    if (header.file_names.empty()) continue;
    const bool fits = column_count == 0 || header.file_names.size() == column_count;
    if (fits || best.file_names.empty()) best = std::move(header);
    if (fits) break;
  }
  // Or a comment stands behind the names
  const std::string_view names = withoutComment(line);
  const bool fits = best.file_names.size() == column_count;
  if (column_count > 0 && !fits && names.size() < line.size()) {
    XyzHeader header = parseXyzHeader(names, column_count);
    if (header.file_names.size() == column_count) {
      header.comment = line.substr(names.size());
      return header;
    }
  }
  return best;
}

bool addUnits(std::string_view line, XyzHeader& header) {
  std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns + 1);
  if (!line.empty() && isTextComma(line.back())) words.emplace_back();
  if (words.size() != header.names.size()) return false;
  Words with_units = header.file_names;
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::string_view unit = words[i];
    while (!unit.empty() && kAroundUnits.find(unit.front()) != unit.npos) unit.remove_prefix(1);
    while (!unit.empty() && kAroundUnits.find(unit.back()) != unit.npos) unit.remove_suffix(1);
    if (isPlaceName(header.names[i]) && !isKnownUnit(unit)) return false;
    if (!unit.empty()) with_units[i] = fmt::format("{} [{}]", with_units[i], unit);
  }
  header.refusal = refusalOfAngles(header.names, with_units);
  header.unit_note = noteOfUnits(header.names, with_units);
  return true;
}

}  // namespace surfeit
