#include "cloud/scans/las_encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace surfeit {
namespace {

constexpr std::int32_t kLeastStored = std::numeric_limits<std::int32_t>::min();
constexpr std::int32_t kMostStored = std::numeric_limits<std::int32_t>::max();
constexpr double kExactPart = 0.01;  // of a step: floats that were multiples of it differ less

// From scene-linear light to a code from 0 to 1 (IEC 61966-2-1).
double srgbCodeOf(double light) {
  return light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

// Stores shades of 16 bits. Returns how many are brighter than white or darker than black, and
// counts those that are no numbers.
std::size_t encodeShades(const LasColumn& column, const std::byte* rows, std::size_t row_bytes,
                         std::size_t count, std::byte* records, std::size_t record_bytes,
                         std::uint64_t& no_numbers) {
  std::size_t misfits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double value =
        rowValue(rows + i * row_bytes + column.value.row_offset, column.value.type);
    std::uint16_t shade = 0;
    if (column.coding == LasColumn::Coding::kShade) {
      shade = static_cast<std::uint16_t>(value * 257);
    } else {
      const double light = value > 0 ? std::min(value, 1.0) : 0;
      std::isnan(value) ? ++no_numbers : misfits += light != value;
      shade = static_cast<std::uint16_t>(std::nearbyint(srgbCodeOf(light) * 65535));
    }
    std::memcpy(records + i * record_bytes + column.value.record_offset, &shade, sizeof shade);
  }
  return misfits;
}

// How far the farthest of scaled values is from what is stored of it; 0 where rounding explains it.
double largestChange(const LasValue& value, const std::byte* rows, std::size_t row_bytes,
                     std::size_t count) {
  double largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double given = rowValue(rows + i * row_bytes + value.row_offset, value.type);
    const double read =
        std::nearbyint((given - value.origin) / value.scale) * value.scale + value.origin;
    const double change = std::abs(read - given);
    const double noise = std::abs(value.scale) * kExactPart +
                         8 * std::numeric_limits<double>::epsilon() * std::abs(given);
    if (change > noise) largest = std::max(largest, change);
  }
  return largest;
}

unsigned bitsOf(const LasField& field, const std::byte* record) {
  return static_cast<unsigned>(record[field.offset]) >> field.shift & ((1u << field.bit_count) - 1);
}
void setBits(const LasField& field, unsigned value, std::byte* record) {
  record[field.offset] |= static_cast<std::byte>(value << field.shift);
}

}  // namespace

LasEncoder::LasEncoder(LasPlan plan, const LasGrid& grid)
    : plan_(std::move(plan)),
      grid_(grid),
      misfits_(plan_.columns.size()),
      no_numbers_(plan_.columns.size()),
      changes_(plan_.columns.size()) {
  least_.fill(kMostStored);
  most_.fill(kLeastStored);
}

Status LasEncoder::encode(const std::byte* rows, std::size_t row_bytes, std::size_t count,
                          const std::string& path, std::vector<std::byte>& records) {
  const std::size_t at = records.size(), record_bytes = plan_.record_bytes;
  records.resize(at + count * record_bytes);  // all bits are 0
  std::byte* const to = records.data() + at;
  for (std::size_t c = 0; c < plan_.columns.size(); ++c) {
    const LasColumn& column = plan_.columns[c];
    misfits_[c] +=
        column.coding == LasColumn::Coding::kValue
            ? encodeLas(column.value, rows, row_bytes, count, to, record_bytes)
            : encodeShades(column, rows, row_bytes, count, to, record_bytes, no_numbers_[c]);
  }
  for (std::size_t c = 0; c < plan_.columns.size(); ++c) {
    const LasValue& value = plan_.columns[c].value;
    if (!value.is_scaled) continue;
    changes_[c] = std::max(changes_[c], largestChange(value, rows, row_bytes, count));
  }
  for (std::size_t i = 0; i < count; ++i, ++count_) {
    std::byte* const record = to + i * record_bytes;
    SURFEIT_RETURN_IF_ERROR(encodePosition(rows + i * row_bytes, path, record));
    countReturn(record);
  }
  return {};
}

Status LasEncoder::encodePosition(const std::byte* row, const std::string& path,
                                  std::byte* record) {
  std::array<std::int32_t, 3> stored = last_;
  std::array<double, 3> given;
  bool is_finite = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    given[axis] = rowValue(row + plan_.position[axis].offset, plan_.position[axis].type);
    is_finite = is_finite && std::isfinite(given[axis]);
  }
  if (!is_finite) {
    ++without_position_;
    if (bitsOf(plan_.withheld, record) == 0) setBits(plan_.withheld, 1, record);
  }
  for (std::size_t axis = 0; axis < 3 && is_finite; ++axis) {
    const double number = std::nearbyint((given[axis] - grid_.origin[axis]) / grid_.scale[axis]);
    if (!(number >= kLeastStored && number <= kMostStored)) {
      return Status::invalidArgument(fmt::format(
          "{}: row {}: {} is {}, expected {} to {}, which scale {} and offset {} can store: they "
          "are those of the LAS file that the result is to be like",
          path, count_, plan_.position[axis].name, given[axis],
          kLeastStored * grid_.scale[axis] + grid_.origin[axis],
          kMostStored * grid_.scale[axis] + grid_.origin[axis], grid_.scale[axis],
          grid_.origin[axis]));
    }
    stored[axis] = static_cast<std::int32_t>(number);
    const double read = stored[axis] * grid_.scale[axis] + grid_.origin[axis];
    largest_move_ = std::max(largest_move_, std::abs(read - given[axis]));
    largest_value_ = std::max(largest_value_, std::abs(given[axis]));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    least_[axis] = std::min(least_[axis], stored[axis]);
    most_[axis] = std::max(most_[axis], stored[axis]);
  }
  last_ = stored;
  std::memcpy(record, stored.data(), sizeof stored);
  return {};
}

void LasEncoder::countReturn(std::byte* record) {
  if (!plan_.has_returns) {
    setBits(plan_.return_number, 1, record);
    setBits(plan_.number_of_returns, 1, record);
  }
  const unsigned number = bitsOf(plan_.return_number, record);
  if (number > 0) ++returns_[number - 1];
}

std::array<double, 3> LasEncoder::boundOf(const std::array<std::int32_t, 3>& stored) const {
  std::array<double, 3> bound{};
  for (std::size_t axis = 0; axis < 3 && count_ > 0; ++axis) {
    bound[axis] = stored[axis] * grid_.scale[axis] + grid_.origin[axis];
  }
  return bound;
}

std::vector<std::string> LasEncoder::notes() const {
  std::vector<std::string> notes;
  // Sums of doubles differ by so much whatever is stored
  const double noise = 8 * std::numeric_limits<double>::epsilon() * largest_value_;
  if (largest_move_ > noise) {
    std::array<double, 3> size;
    for (std::size_t axis = 0; axis < 3; ++axis) size[axis] = most()[axis] - least()[axis];
    std::sort(size.begin(), size.end());
    const double spacing = size[1] > 0 ? std::sqrt(size[1] * size[2] / static_cast<double>(count_))
                                       : size[2] / static_cast<double>(count_);
    notes.push_back(fmt::format(
        "points move by up to {:.2g}, since LAS stores multiples of {:g}; their "
        "spacing is about {:.2g}",
        largest_move_, *std::max_element(grid_.scale.begin(), grid_.scale.end()), spacing));
  }
  for (std::size_t c = 0; c < misfits_.size(); ++c) {
    if (no_numbers_[c] > 0) {
      notes.push_back(fmt::format("{} values of {} are not numbers and become black",
                                  no_numbers_[c], plan_.columns[c].property));
    }
    if (changes_[c] > 0) {
      notes.push_back(fmt::format("{} changes by up to {:.2g}, since LAS stores multiples of {:g}",
                                  plan_.columns[c].property, changes_[c],
                                  plan_.columns[c].value.scale));
    }
    if (misfits_[c] == 0) continue;
    const bool is_color = plan_.columns[c].coding != LasColumn::Coding::kValue;
    notes.push_back(fmt::format("{} values of {} {}", misfits_[c], plan_.columns[c].property,
                                is_color
                                    ? "are not from 0 to 1 and become the nearest shade"
                                    : "do not fit their field and become the nearest that does"));
  }
  if (without_position_ > 0) {
    notes.push_back(
        fmt::format("{} points without a finite position are written as withheld, at the place of "
                    "the point before them",
                    without_position_));
  }
  return notes;
}

bool keepsLasValues(const LasColumn& column, const std::byte* rows, std::size_t row_bytes,
                    std::size_t count) {
  constexpr std::size_t kRecord = 8;
  std::vector<std::byte> records(count * kRecord), read(count * sizeof(double));
  LasValue value = column.value;
  value.record_offset = 0;
  if (encodeLas(value, rows, row_bytes, count, records.data(), kRecord) > 0) return false;
  // The nearest step is near enough, and how near is told
  const double tolerance = value.is_scaled ? std::abs(value.scale) * (0.5 + kExactPart) : 0;
  value.row_offset = 0;
  value.type =
      value.bit_count != 0 || !value.is_scaled ? plyTypeOf(value.stored) : ValueType::kFloat64;
  decodeLas(value, records.data(), kRecord, count, read.data(), sizeof(double));
  for (std::size_t i = 0; i < count; ++i) {
    const double given =
        rowValue(rows + i * row_bytes + column.value.row_offset, column.value.type);
    const double got = rowValue(read.data() + i * sizeof(double), value.type);
    if (!(std::abs(given - got) <= tolerance)) return false;
  }
  return true;
}

LasGrid chooseLasGrid(const std::array<double, 3>& least, const std::array<double, 3>& most,
                      std::uint64_t count, bool is_float) {
  constexpr double kUsual = 1e-4, kFloatSteps = 1 << 24, kSpacingSteps = 1000;
  std::array<double, 3> size;
  for (std::size_t axis = 0; axis < 3; ++axis) size[axis] = most[axis] - least[axis];
  std::array<double, 3> sorted = size;
  std::sort(sorted.begin(), sorted.end());

  // As fine as floats are, or a thousandth of what lies between points
  double wanted = kUsual;
  if (is_float && sorted[2] > 0) {
    wanted = std::min(wanted, sorted[2] / kFloatSteps);
  } else if (sorted[2] > 0) {
    const double spacing = sorted[1] > 0
                               ? std::sqrt(sorted[1] * sorted[2] / static_cast<double>(count))
                               : sorted[2] / static_cast<double>(count);
    wanted = std::min(wanted, spacing / kSpacingSteps);
  }
  // No finer than doubles are at such coordinates
  double largest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    largest = std::max({largest, std::abs(least[axis]), std::abs(most[axis])});
  }
  wanted = std::max(wanted, largest * std::numeric_limits<double>::epsilon());
  int exponent = static_cast<int>(std::floor(std::log10(wanted) + 1e-9));
  const auto power = [](int e) { return e < 0 ? 1 / std::pow(10.0, -e) : std::pow(10.0, e); };
  // Half the range of 32 bits, so that the offset may be a round number
  while (sorted[2] / power(exponent) > 0x7fffffff) ++exponent;

  LasGrid grid;
  const double step = power(exponent + 6);  // of offsets, less than a thousandth of the range
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.scale[axis] = power(exponent);
    const double middle = least[axis] + size[axis] / 2;
    const bool fits_from_zero =
        std::max(std::abs(least[axis]), std::abs(most[axis])) / grid.scale[axis] < 0x7fffffff;
    grid.origin[axis] = fits_from_zero ? 0 : std::round(middle / step) * step;
  }
  return grid;
}

}  // namespace surfeit
