#include "surfels/rows/no_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <vector>

#include "cloud/rows/surfel_names.h"
#include "surfels/rows/sampled_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostProperties = 64, kMostTold = 4;

// Smaller numbers are values.
constexpr double kLeastSize = 999;
// What programs write where there is no value.
constexpr double kNoData[] = {-999, -9999, -99999, -999999, -32767, -32768, -2147483648., -1e10,
                              1e10, -1e20, 1e20,   -1e30,   1e30,   -1e32,  1e32};
// Floats and doubles near the largest: written with few digits they differ.
constexpr double kHugeFloat = 3.4e38, kHugeDouble = 1.79e308;

bool isNoDataNumber(double value) {
  const double size = std::abs(value);
  if (size < kLeastSize) return false;
  if (size >= kHugeFloat) return size <= 3.41e38 || (size >= kHugeDouble && std::isfinite(value));
  if (size < 1e19)
    return std::find(std::begin(kNoData), std::end(kNoData), value) != std::end(kNoData);
  // 1e30 as a float is another number
  return std::any_of(std::begin(kNoData), std::end(kNoData), [&](double known) {
    return std::abs(value - known) <= 1e-6 * std::abs(known);
  });
}

// What was seen of one property.
class Column {
 public:
  Column(const RowProperty& property, std::size_t row_bytes)
      : property_(&property), row_bytes_(row_bytes) {}

  void add(Bytes rows) {
    visitValueType(property_->type, [&]<typename T>(std::type_identity<T>) {
      for (std::size_t at = property_->offset; at < rows.size(); at += row_bytes_) {
        T stored;
        std::memcpy(&stored, &rows[at], sizeof stored);
        take(static_cast<double>(stored));
      }
    });
  }

  // The number that mostly stands for no value: off all others; 0 records where there is none.
  struct Found {
    double number = 0;
    std::uint64_t records = 0;
    bool operator==(const Found&) const = default;
  };
  Found noData() const {
    Found most;
    for (const Found& found : found_) {
      const double gap = std::max(least_ - found.number, found.number - largest_);
      const bool is_off = gap > largest_ - least_ || (found.number < 0 && least_ >= 0);
      if (least_ <= largest_ && is_off && found.records > most.records) most = found;
    }
    return most;
  }

  const std::string& name() const { return property_->name; }
  // "z != -9999", as filters compare it.
  std::string filterOf(double number) const {
    const bool is_word = std::all_of(name().begin(), name().end(), [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '_';
    });
    const std::string text = property_->type == ValueType::kFloat32
                                 ? fmt::format("{}", static_cast<float>(number))
                                 : fmt::format("{}", number);
    return fmt::format("{0}{1}{0} != {2}", is_word ? "" : "'", name(), text);
  }

 private:
  static constexpr std::size_t kMostNumbers = 4;

  void take(double value) {
    if (isNoDataNumber(value)) {
      const auto known = std::find_if(found_.begin(), found_.end(),
                                      [&](const Found& found) { return found.number == value; });
      if (known != found_.end()) {
        ++known->records;
        return;
      }
      if (found_.size() < kMostNumbers) {
        found_.push_back({value, 1});
        return;
      }
    }
    if (!std::isfinite(value)) return;
    least_ = std::min(least_, value);
    largest_ = std::max(largest_, value);
  }

  const RowProperty* property_;
  std::size_t row_bytes_;
  std::vector<Found> found_;
  double least_ = std::numeric_limits<double>::infinity();
  double largest_ = -std::numeric_limits<double>::infinity();
};

// Places of a cloud that lies elsewhere: those at 0 0 0.
class Origins {
 public:
  explicit Origins(const RowLayout& element) : row_bytes_(element.row_bytes) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      axes_[axis] = element.find(kPositionNames[axis]);
      has_place_ = has_place_ && axes_[axis] != nullptr && !axes_[axis]->is_list;
    }
  }

  void add(Bytes rows) {
    if (!has_place_) return;
    for (std::size_t at = 0; at < rows.size(); at += row_bytes_) {
      double place[3];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        place[axis] = rowValue(&rows[at + axes_[axis]->offset], axes_[axis]->type);
      }
      if (place[0] == 0 && place[1] == 0 && place[2] == 0) {
        ++count_;
        continue;
      }
      ++others_;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!(std::abs(place[axis]) < 1e19) || isNoDataNumber(place[axis])) continue;
        least_[axis] = std::min(least_[axis], place[axis]);
        largest_[axis] = std::max(largest_[axis], place[axis]);
      }
    }
  }

  // Records at 0 0 0 where all others, which are several, lie farther away than they lie apart;
  // else 0.
  std::uint64_t strayCount() const {
    constexpr std::uint64_t kLeastOthers = 8;
    if (others_ < kLeastOthers) return 0;
    double width = 0, gap = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (least_[axis] > largest_[axis]) return 0;
      width = std::max(width, largest_[axis] - least_[axis]);
      gap = std::max({gap, least_[axis], -largest_[axis]});
    }
    return gap > width ? count_ : 0;
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const RowProperty* axes_[3] = {};
  bool has_place_ = true;
  std::size_t row_bytes_;
  std::uint64_t count_ = 0, others_ = 0;
  double least_[3] = {kInfinity, kInfinity, kInfinity};
  double largest_[3] = {-kInfinity, -kInfinity, -kInfinity};
};

// Properties that can hold such a number; the first so many.
std::vector<Column> columnsOf(const RowLayout& element) {
  std::vector<Column> columns;
  for (const RowProperty& property : element.properties) {
    const bool is_signed = isFloatType(property.type) || property.type == ValueType::kInt16 ||
                           property.type == ValueType::kInt32;
    if (property.is_list || !is_signed || columns.size() == kMostProperties) continue;
    // The largest code of a normal is a direction
    const bool is_normal = std::find(std::begin(kNormalNames), std::end(kNormalNames),
                                     property.name) != std::end(kNormalNames);
    if (is_normal && !isFloatType(property.type)) continue;
    columns.emplace_back(property, element.row_bytes);
  }
  return columns;
}

// Returns how many rows were seen.
Result<std::uint64_t> look(RowReader& reader, std::vector<Column>& columns, Origins& origins) {
  std::uint64_t seen = 0;
  SURFEIT_RETURN_IF_ERROR(
      sampleRows(reader, {.places = 64, .rows_of_place = 1024}, [&](Bytes rows) {
        for (Column& column : columns) column.add(rows);
        origins.add(rows);
        seen += rows.size() / reader.element().row_bytes;
        return true;
      }));
  return seen;
}

}  // namespace

Result<std::string> noteOfNoData(RowReader& reader) {
  std::vector<Column> columns = columnsOf(reader.element());
  if (columns.empty()) return std::string();
  Origins origins(reader.element());
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t seen, look(reader, columns, origins));
  std::string found, filter;
  if (const std::uint64_t count = origins.strayCount(); count > 0) {
    found = fmt::format("x y z are 0 in {}", count);
    filter = "(x != 0 or y != 0 or z != 0)";
  }
  std::size_t told = 0;
  for (std::size_t i = 0; i < columns.size();) {
    const Column::Found no_data = columns[i].noData();
    if (no_data.records == 0) {
      ++i;
      continue;
    }
    if (told++ == kMostTold) {
      found += " ...";
      break;
    }
    // Neighbours with the same, as of a color, are told together
    std::string names;
    const std::size_t first = i;
    for (; i < columns.size() && columns[i].noData() == no_data; ++i) {
      names += fmt::format("{}{}", names.empty() ? "" : " ", columns[i].name());
      filter +=
          fmt::format("{}{}", filter.empty() ? "" : " and ", columns[i].filterOf(no_data.number));
    }
    found += fmt::format("{}{} {} {:.6g} in {}", found.empty() ? "" : ", ", names,
                         i - first > 1 ? "are" : "is", no_data.number, no_data.records);
  }
  if (found.empty()) return found;
  return fmt::format(
      "{} of {} records looked at, which mostly stands for no value: --filter \"{}\" leaves such "
      "records out",
      found, seen, filter);
}

}  // namespace surfeit
