#include "io/formats/xyz_layout.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <iterator>

#include "io/formats/property_renames.h"
#include "io/ply_number.h"

namespace surfeit {
namespace {

constexpr std::size_t kSampleRows = 1000;
constexpr std::size_t kMaxNameChars = 56;
constexpr std::uint64_t kLargestExactFloat = 1 << 24;

constexpr std::string_view kOurNames[] = {"x",    "y",     "z",      "nx",    "ny",        "nz",
                                          "red",  "green", "blue",   "alpha", "intensity", "radius",
                                          "area", "width", "pscale", "group"};
struct Alias {
  std::string_view alias, name;
};
constexpr Alias kAliases[] = {{"r", "red"},       {"g", "green"},     {"b", "blue"},
                              {"normal_x", "nx"}, {"normal_y", "ny"}, {"normal_z", "nz"},
                              {"i", "intensity"}};

std::string lowerOf(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::string ourName(std::string_view word) {
  if (word.size() >= 2 && word.front() == '"' && word.back() == '"') {
    word = word.substr(1, word.size() - 2);
  }
  const std::string lower = lowerOf(word);
  for (const Alias& alias : kAliases) {
    if (alias.alias == lower) return std::string(alias.name);
  }
  if (std::find(std::begin(kOurNames), std::end(kOurNames), lower) != std::end(kOurNames)) {
    return lower;
  }
  std::string name(word.substr(0, kMaxNameChars));
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !(c > ' ' && c < '\x7f'); }, '_');
  return name.empty() ? "_" : name;
}

bool contains(std::span<const std::string> names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Whether the float next to a number gives it back, written with as many decimals. So do floats
// that a program wrote with more decimals than they have.
bool isFloat(std::string_view word, double value) {
  std::byte single[4];
  if (!std::isfinite(value) || !parsePlyNumber(word, PlyType::kFloat32, single)) return true;
  const std::size_t exponent_at = std::min(word.find_first_of("eE"), word.size());
  const std::size_t point_at = std::min(word.find('.'), exponent_at);
  double decimals = point_at < exponent_at ? double(exponent_at - point_at - 1) : 0;
  std::byte exponent[8];
  if (exponent_at < word.size() &&
      parsePlyNumber(word.substr(exponent_at + 1), PlyType::kFloat64, exponent)) {
    decimals -= plyValue(exponent, PlyType::kFloat64);
  }
  // A little more than half a unit: floats are often exactly half way, and both sides are rounded
  const double half_unit = (0.5 + 1e-6) * std::pow(10.0, -decimals);
  return std::abs(plyValue(single, PlyType::kFloat32) - value) <= half_unit;
}

bool isWhole(std::string_view word) {
  return !word.empty() && word.size() <= 18 &&
         std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool areUnitVectors(std::span<const XyzColumn> triple) {
  bool has_any = false;
  for (std::size_t row = 0; row < triple[0].values.size(); ++row) {
    const double length =
        std::hypot(triple[0].values[row], triple[1].values[row], triple[2].values[row]);
    if (length == 0) continue;
    if (!(std::abs(length - 1) <= 0.01)) return false;
    has_any = true;
  }
  return has_any;
}

bool areBytes(std::span<const XyzColumn> triple) {
  return std::all_of(triple.begin(), triple.end(), [](const XyzColumn& column) {
    return column.are_wholes && std::all_of(column.values.begin(), column.values.end(),
                                            [](double value) { return value <= 255; });
  });
}

bool isPlace(std::string_view name) { return name == "x" || name == "y" || name == "z"; }
bool isColor(std::string_view name) { return name == "red" || name == "green" || name == "blue"; }
bool isSmallCount(std::string_view name) {
  return name == "group" || name == "light_group" || name == "two_sided";
}

// Looks at the words of one line that are asked for.
void scanLine(std::string_view line, std::vector<XyzScan::Column>& columns) {
  const char* at = line.data();
  const char* const end = at + line.size();
  std::size_t column = 0;
  for (XyzScan::Column& wanted : columns) {
    for (;; ++column) {
      while (at < end && isTextBlank(*at)) ++at;
      if (column > 0 && at < end && isTextComma(*at)) ++at;
      while (at < end && isTextBlank(*at)) ++at;
      if (column == wanted.column) break;
      while (at < end && !isTextBlank(*at) && !isTextComma(*at)) ++at;
    }
    const char* const word = at;
    std::uint64_t value = 0;
    for (; at < end && *at >= '0' && *at <= '9'; ++at) {
      value = value * 10 + static_cast<std::uint64_t>(*at - '0');
    }
    const bool is_word_end = at == end || isTextBlank(*at) || isTextComma(*at);
    if (at == word || at - word > 18 || !is_word_end) wanted.are_wholes = false;
    wanted.largest = std::max(wanted.largest, value);
    while (at < end && !isTextBlank(*at) && !isTextComma(*at)) ++at;
    ++column;
  }
}

}  // namespace

std::vector<std::string> xyzHeaderNames(std::string_view line) {
  line = trimmedLine(line);
  while (line.starts_with('#') || line.starts_with('/')) line.remove_prefix(1);
  const std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns + 1);
  if (words.size() > kMaxXyzColumns) return {};
  std::vector<std::string> names;
  for (const std::string_view word : words) names.push_back(ourName(word));
  for (const std::string_view name : {"x", "y", "z"}) {
    if (std::count(names.begin(), names.end(), name) != 1) return {};
  }
  DistinctNames distinct;
  for (std::string& name : names) name = distinct.add(name);
  return names;
}

bool isXyzNumber(std::string_view word) {
  std::byte value[8];
  return parsePlyNumber(word, PlyType::kFloat64, value);
}

std::vector<XyzColumn> sampleXyz(std::string_view lines) {
  std::vector<XyzColumn> columns;
  std::size_t rows = 0;
  while (!lines.empty() && rows < kSampleRows) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    const std::string_view line = trimmedLine(lines.substr(0, end));
    lines.remove_prefix(std::min(end + 1, lines.size()));
    if (line.empty() || isTextComment(line)) continue;
    const std::vector<std::string_view> words = wordsOf(line, kMaxXyzColumns + 1);
    if (columns.empty()) columns.resize(words.size());
    if (words.size() != columns.size() || !std::all_of(words.begin(), words.end(), isXyzNumber)) {
      continue;
    }
    ++rows;
    for (std::size_t i = 0; i < words.size(); ++i) {
      std::byte bytes[8];
      parsePlyNumber(words[i], PlyType::kFloat64, bytes);
      const double value = plyValue(bytes, PlyType::kFloat64);
      columns[i].values.push_back(value);
      columns[i].are_floats = columns[i].are_floats && isFloat(words[i], value);
      columns[i].are_wholes = columns[i].are_wholes && isWhole(words[i]);
    }
  }
  return columns;
}

std::vector<std::string> nameXyzColumns(std::span<const XyzColumn> sample) {
  std::vector<std::string> names;
  DistinctNames distinct;
  const auto add = [&](std::initializer_list<const char*> more) {
    for (const char* const name : more) names.push_back(distinct.add(name));
  };
  add({"x", "y", "z"});
  while (names.size() < sample.size()) {
    const std::size_t left = sample.size() - names.size();
    const std::span<const XyzColumn> rest = sample.subspan(names.size());
    const bool has_color = contains(names, "red");
    if (left >= 3 && !contains(names, "nx") && areUnitVectors(rest.first(3))) {
      add({"nx", "ny", "nz"});
    } else if (left == 4 && !has_color && areBytes(rest.last(3))) {
      add({"intensity", "red", "green", "blue"});
    } else if (left >= 3 && !has_color && (left == 3 || areBytes(rest.first(3)))) {
      add({"red", "green", "blue"});
    } else {
      add({names.size() == 3 ? "intensity" : "scalar"});
    }
  }
  return names;
}

Result<XyzScan> scanXyz(LineSource& source, std::span<const std::size_t> columns) {
  XyzScan scan;
  for (const std::size_t column : columns) scan.columns.push_back({column, true, 0});
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::string_view lines, source.lines());
    if (lines.empty()) return scan;
    const char* at = lines.data();
    const char* const end = at + lines.size();
    std::uint64_t line_count = 0;
    while (at < end) {
      const void* const found = std::memchr(at, '\n', static_cast<std::size_t>(end - at));
      const char* const line_end = found ? static_cast<const char*>(found) : end;
      while (at < line_end && isTextBlank(*at)) ++at;
      const std::string_view line(at, static_cast<std::size_t>(line_end - at));
      if (!line.empty() && !isTextComment(line)) {
        ++scan.row_count;
        if (!scan.columns.empty()) scanLine(line, scan.columns);
      }
      at = line_end + (found ? 1 : 0);
      ++line_count;
    }
    source.consume(lines.size(), line_count);
  }
}

std::vector<std::size_t> wholeColumns(std::span<const XyzColumn> sample,
                                      std::span<const std::string> names) {
  std::vector<std::size_t> columns;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    if (sample[i].are_wholes && !isPlace(names[i])) columns.push_back(i);
  }
  return columns;
}

std::vector<PlyType> typeXyzColumns(std::span<const XyzColumn> sample,
                                    std::span<const std::string> names, const XyzScan& scan) {
  // By the first rows
  std::vector<PlyType> types;
  bool are_places_floats = true;
  for (std::size_t i = 0; i < names.size(); ++i) {
    types.push_back(sample[i].are_floats ? PlyType::kFloat32 : PlyType::kFloat64);
    if (isPlace(names[i]) && !sample[i].are_floats) are_places_floats = false;
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (isPlace(names[i]) && !are_places_floats) types[i] = PlyType::kFloat64;
  }

  // By all rows
  std::size_t whole_colors = 0;
  std::uint64_t largest_color = 0;
  for (const XyzScan::Column& column : scan.columns) {
    if (!column.are_wholes) continue;
    if (isColor(names[column.column])) {
      ++whole_colors;
      largest_color = std::max(largest_color, column.largest);
    } else if (isSmallCount(names[column.column]) && column.largest <= 255) {
      types[column.column] = PlyType::kUint8;
    } else if (column.largest > kLargestExactFloat) {
      types[column.column] = PlyType::kFloat64;
    }
  }
  if (whole_colors == 3 && largest_color > 1 && largest_color <= 65535) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!isColor(names[i])) continue;
      types[i] = largest_color <= 255 ? PlyType::kUint8 : PlyType::kUint16;
    }
  }
  return types;
}

}  // namespace surfeit
