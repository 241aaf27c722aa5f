#include "cloud/text/xyz_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>

#include "cloud/parts/property_renames.h"
#include "cloud/text/xyz_header.h"

namespace surfeit {
namespace {

constexpr double kLargestExactFloat = 1 << 24;
constexpr double kByteColor = 255, kWordColor = 65535;
constexpr std::uint64_t kLeastNumbered = 8;

bool hasName(std::span<const std::string> names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool isColor(std::string_view name) { return name == "red" || name == "green" || name == "blue"; }
bool isSmallCount(std::string_view name) {
  return name == "group" || name == "light_group" || name == "two_sided";
}

// Whether columns are colors of one range: its end, else 0.
double colorRange(std::span<const XyzColumn> columns) {
  double least = 0, largest = 0;
  bool are_wholes = true, are_reals = true;
  for (const XyzColumn& column : columns) {
    if (!column.are_numbers || column.least > column.largest) return 0;
    least = std::min(least, column.least);
    largest = std::max(largest, column.largest);
    are_wholes = are_wholes && column.are_wholes;
    are_reals = are_reals && !column.are_wholes;
  }
  if (least < 0 || largest > kWordColor) return 0;
  if (are_wholes) return largest > kByteColor ? kWordColor : kByteColor;
  if (largest <= 1) return 1;
  return are_reals && largest <= kByteColor ? kByteColor : 0;
}

using Names = std::vector<const char*>;

// Readings of columns that are no normals, between normals or the ends.
class Readings {
 public:
  explicit Readings(std::span<const XyzColumn> columns) {
    if (columns.size() < 3) return;
    for (std::size_t i = 0; i + 3 <= columns.size(); ++i) {
      const double range = colorRange(columns.subspan(i, 3));
      if (range == 0) continue;
      // What follows colors may be their alpha
      const bool has_alpha =
          i + 3 < columns.size() && i + 4 == columns.size() && isAlpha(columns[i + 3], range);
      if (has_alpha) add(i, columns.size(), true);
      if (!has_alpha || columns.size() != 4) add(i, columns.size(), false);
    }
    if (columns.size() == 4) settleFour(columns);
  }

  const std::vector<Names>& all() const { return all_; }

 private:
  static bool isAlpha(const XyzColumn& column, double range) {
    return column.are_numbers && column.least >= 0 && column.largest <= range;
  }

  void add(std::size_t color, std::size_t count, bool has_alpha) {
    Names names(count, "scalar");
    names[color] = "red";
    names[color + 1] = "green";
    names[color + 2] = "blue";
    if (has_alpha) names[color + 3] = "alpha";
    all_.push_back(std::move(names));
  }

  // A column of one value beside three that vary: the full range is opaque, any other an intensity
  void settleFour(std::span<const XyzColumn> columns) {
    if (all_.size() != 2) return;
    const bool is_first_constant = columns[0].isConstant(),
               is_last_constant = columns[3].isConstant();
    const double range = colorRange(columns.first(3));
    const double last_range = colorRange(columns.last(3));
    if (last_range > 0 && last_range < range) {  // bytes behind an intensity that is none
      all_.erase(all_.begin());
    } else if (is_last_constant && !is_first_constant && columns[3].largest == range) {
      all_.pop_back();
    } else if (is_first_constant && !is_last_constant) {
      all_.erase(all_.begin());
    }
  }

  std::vector<Names> all_;
};

// "red green blue alpha"
std::string joined(const Names& names) { return fmt::format("{}", fmt::join(names, " ")); }

Status severalReadings(std::size_t first, std::size_t count, const std::vector<Names>& readings) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(readings.size(), 3); ++i) {
    text += fmt::format("{}'{}'", i == 0 ? "" : ", or ", joined(readings[i]));
  }
  std::string choice;
  const Names example = readings.empty() ? Names(count, "NAME") : readings.front();
  for (std::size_t i = 0; i < example.size(); ++i) {
    choice += fmt::format("{}{}={}", i == 0 ? "" : ",", first + i + 1, example[i]);
  }
  if (readings.empty()) {
    text = "neither normals of unit length nor colors";
  }
  return Status::corruption(
      fmt::format("columns {} to {} have no names, and their values may be {}; say which: "
                  "--channels {} (NUMBER=NAME, NUMBER=- drops a column)",
                  first + 1, first + count, text, choice));
}

// Seconds since 1970, or thousandths, millionths, billionths of them: no map has such places.
bool areTimes(const XyzColumn& column) {
  constexpr double kLeast = 1e9, kLargest = 4e9;
  for (const double scale : {1., 1e3, 1e6, 1e9}) {
    if (column.least >= kLeast * scale && column.largest <= kLargest * scale) return true;
  }
  return false;
}

}  // namespace

// Places on a line of a grid are whole numbers along all axes.
Status checkFirstXyzColumn(const XyzTable& table) {
  const std::span<const XyzColumn> columns = table.columns;
  if (columns.size() > 3 && table.row_count > 0 && columns[0].are_numbers && areTimes(columns[0])) {
    return Status::corruption(fmt::format(
        "column 1 has no name and runs from {:.15g} to {:.15g}: it may be a time, or x; say which: "
        "--channels 1=gps_time,2=x,3=y,4=z or --channels 1=x,2=y,3=z",
        columns[0].least, columns[0].largest));
  }
  const bool may_count = columns.size() > 3 && table.row_count >= kLeastNumbered &&
                         columns[0].are_wholes && columns[0].counts_rows &&
                         std::any_of(columns.begin() + 1, columns.begin() + 4,
                                     [](const XyzColumn& column) { return !column.are_wholes; });
  if (!may_count) return {};
  return Status::corruption(fmt::format(
      "column 1 has no name and counts on from {:.0f} to {:.0f}: it may number the "
      "points, or be x; say which: --channels 1=-,2=x,3=y,4=z or --channels 1=x,2=y,3=z",
      table.columns[0].least, table.columns[0].largest));
}

Result<std::vector<std::string>> nameXyzColumns(const XyzTable& table, bool is_pts) {
  SURFEIT_RETURN_IF_ERROR(checkFirstXyzColumn(table));
  const std::span<const XyzColumn> columns = table.columns;
  std::vector<std::string> names;
  DistinctNames distinct;
  const auto add = [&](std::span<const char* const> more) {
    for (const char* const name : more) {
      const bool is_intensity = names.size() == 3 && std::string_view(name) == "scalar";
      names.push_back(distinct.add(is_intensity ? "intensity" : name));
    }
  };
  constexpr const char* kPlace[] = {"x", "y", "z"};
  constexpr const char* kNormal[] = {"nx", "ny", "nz"};
  add(kPlace);
  while (names.size() < columns.size()) {
    const std::size_t first = names.size();
    const auto is_normal = [&](std::size_t i) {
      return !hasName(names, "nx") && i + 3 <= columns.size() && table.are_unit_vectors[i];
    };
    if (is_normal(first)) {
      add(kNormal);
      continue;
    }
    std::size_t end = first + 1;
    while (end < columns.size() && !is_normal(end)) ++end;
    const std::size_t count = end - first;
    const bool may_be_color = count >= 3 && !hasName(names, "red");
    std::vector<Names> readings;
    if (may_be_color) readings = Readings(columns.subspan(first, count)).all();
    if (is_pts && count == 4 && readings.size() == 2) readings.erase(readings.begin());
    if (readings.size() > 1 || (may_be_color && count == 3 && readings.empty())) {
      return severalReadings(first, count, readings);
    }
    add(readings.empty() ? Names(count, "scalar") : readings.front());
  }
  return names;
}

std::vector<ValueType> typeXyzColumns(const XyzTable& table, std::span<const std::string> names) {
  std::vector<ValueType> types;
  bool are_places_floats = true, are_colors_wholes = true;
  double largest_color = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const XyzColumn& column = table.columns[i];
    const bool is_large_count = column.are_wholes && column.largest > kLargestExactFloat;
    const bool is_float = column.are_floats && !is_large_count;
    types.push_back(is_float ? ValueType::kFloat32 : ValueType::kFloat64);
    if (isSmallCount(names[i]) && column.are_wholes && column.least >= 0 && column.largest <= 255) {
      types[i] = ValueType::kUint8;
    }
    if (isPlaceName(names[i]) && !column.are_floats) are_places_floats = false;
    if (!isColor(names[i])) continue;
    are_colors_wholes = are_colors_wholes && column.are_wholes && column.least >= 0;
    largest_color = std::max(largest_color, column.largest);
  }
  const bool are_coded = are_colors_wholes && largest_color > 1 && largest_color <= kWordColor;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (isPlaceName(names[i]))
      types[i] = are_places_floats ? ValueType::kFloat32 : ValueType::kFloat64;
    const XyzColumn& column = table.columns[i];
    const double range = largest_color <= kByteColor ? kByteColor : kWordColor;
    const bool is_coded_alpha = names[i] == "alpha" && column.are_wholes && column.least >= 0 &&
                                column.largest > 1 && column.largest <= range;
    if (are_coded && (isColor(names[i]) || is_coded_alpha)) {
      types[i] = range == kByteColor ? ValueType::kUint8 : ValueType::kUint16;
    }
  }
  return types;
}

}  // namespace surfeit
