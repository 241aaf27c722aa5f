#include "index/clouds/grid_thinner.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>

#include "cloud/edits/row_transform.h"
#include "cloud/rows/channels.h"
#include "cloud/rows/surfel_names.h"
#include "core/square_strata.h"

namespace surfeit {
namespace {

constexpr double kMostCells = 0x1p53;  // from 0 on along an axis: whole numbers that doubles tell
constexpr int kMostGrid = 511;         // and least, negative: ten bits above those of a cell
constexpr int kCellBits = 54;          // of a number of a cell, with its sign
constexpr std::uint64_t kRowsPerLook = 65536;

// What is sorted by cell. The sums of the row follow.
struct CellHead {
  std::uint64_t mixed_cell = 0;  // tells cells apart, given y and z: few rows share it
  std::uint64_t y = 0, z = 0;
  std::uint64_t distance_sq = 0, row = 0;  // their bytes from the front: records compare as bytes

  bool isSameCell(const CellHead& other) const {
    return mixed_cell == other.mixed_cell && y == other.y && z == other.z;
  }
};
static_assert(sizeof(CellHead) == 40);

// What is sorted by row. The sums of the cell follow.
struct PickHead {
  std::uint64_t row = 0, count = 0;
  double growth = 1;  // of lengths
};
static_assert(sizeof(PickHead) == 24);

template <typename Head>
Head headOf(const std::byte* record) {
  Head head;
  std::memcpy(&head, record, sizeof head);
  return head;
}

double numberAt(const std::byte* bytes, std::size_t i) {
  double number = 0;
  std::memcpy(&number, bytes + i * sizeof number, sizeof number);
  return number;
}

void store(double value, const RowProperty& property, std::byte* row) {
  visitValueType(property.type, [&]<typename T>(std::type_identity<T>) {
    const T typed = static_cast<T>(value);
    std::memcpy(row + property.offset, &typed, sizeof typed);
  });
}

}  // namespace

Status GridThinner::checkSpacing(double spacing) {
  if (std::isfinite(spacing) && spacing > 0) return {};
  return Status::invalidArgument(
      fmt::format("spacing: found {}, expected a finite length above 0", spacing));
}

Result<std::unique_ptr<GridThinner>> GridThinner::create(Options options,
                                                         const RowLayout& element) {
  if (!options.cameras) SURFEIT_RETURN_IF_ERROR(checkSpacing(options.spacing));
  std::unique_ptr<GridThinner> thinner(new GridThinner(std::move(options)));
  thinner->row_bytes_ = element.row_bytes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const RowProperty* const property = element.find(kPositionNames[axis]);
    if (property == nullptr) {
      return Status::invalidArgument(
          fmt::format("spacing: found no property {}, expected positions", kPositionNames[axis]));
    }
    thinner->position_[axis] = *property;
  }
  for (const RowChannel& channel : channelsOf(element)) {
    const RowTransform::Role role = RowTransform::roleOf(channel);
    if (!RowTransform::isSize(role)) continue;
    std::vector<RowProperty>& list =
        role == RowTransform::Role::kLength ? thinner->lengths_ : thinner->sums_;
    if (role == RowTransform::Role::kArea) thinner->area_ = list.size();
    for (const std::size_t i : channel.properties) list.push_back(element.properties[i]);
  }
  thinner->totals_.resize(thinner->sums_.size());
  thinner->cells_.emplace(thinner->sorting(sizeof(CellHead)));
  thinner->picks_.emplace(thinner->sorting(sizeof(PickHead)));
  return thinner;
}

ExternalSorter::Options GridThinner::sorting(std::size_t head_bytes) const {
  return {.record_bytes = head_bytes + sums_.size() * sizeof(double),
          .memory_bytes = options_.memory_bytes / 2,
          .temporary_directory = options_.temporary_directory};
}

Result<std::optional<GridThinner::Place>> GridThinner::placeOf(const std::byte* row) const {
  glm::dvec3 at(0);
  for (int axis = 0; axis < 3; ++axis) {
    const RowProperty& property = position_[std::size_t(axis)];
    at[axis] = rowValue(row + property.offset, property.type);
    if (!std::isfinite(at[axis])) return std::optional<Place>();
  }
  Place place;
  double spacing = options_.spacing;
  if (options_.cameras) {
    const double exponent = std::round(0.5 * std::log2(options_.cameras->areaAt(at)));
    place.grid = int(std::clamp(exponent, double(-kMostGrid), double(kMostGrid)));
    spacing = std::ldexp(1.0, place.grid);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double cells = at[axis] / spacing;
    if (!(std::abs(cells) < kMostCells)) {
      return Status::invalidArgument(fmt::format(
          "spacing: found {} and a position {} along {}, expected fewer than 2^53 cells from 0: "
          "give a larger spacing",
          spacing, at[axis], kPositionNames[axis]));
    }
    const double cell = std::floor(cells);
    const double off = cells - cell - 0.5;
    place.cell[std::size_t(axis)] = static_cast<std::int64_t>(cell);
    place.distance_sq += off * off;
  }
  return std::optional<Place>(place);
}

// Of a row's sums; what is no number that can be added counts as 0.
double GridThinner::valueOf(const std::byte* row, std::size_t sum) const {
  const double value = rowValue(row + sums_[sum].offset, sums_[sum].type);
  const bool counts = std::isfinite(value) && (value > 0 || area_ != sum);
  return counts ? value : 0;
}

Status GridThinner::measure(const std::byte* rows, std::size_t count) {
  record_.resize(sizeof(CellHead) + sums_.size() * sizeof(double));
  for (std::size_t i = 0; i < count; ++i, rows += row_bytes_) {
    const std::uint64_t number = measured_++;
    SURFEIT_ASSIGN_OR_RETURN(const std::optional<Place> place, placeOf(rows));
    if (!place) {
      ++placeless_;
      continue;
    }
    CellHead head;
    const auto cell = [&](std::size_t axis) { return std::uint64_t(place->cell[axis]); };
    head.y = cell(1);
    head.z = cell(2);
    // One number of x and grid for each number of this
    const std::uint64_t grid = std::uint64_t(place->grid + kMostGrid + 1) << kCellBits;
    const std::uint64_t x = (cell(0) & ((std::uint64_t{1} << kCellBits) - 1)) | grid;
    head.mixed_cell = mixBits(x ^ hashOf(mixBits(head.y), head.z));
    head.distance_sq = __builtin_bswap64(std::bit_cast<std::uint64_t>(place->distance_sq));
    head.row = __builtin_bswap64(number);
    std::memcpy(record_.data(), &head, sizeof head);
    for (std::size_t s = 0; s < sums_.size(); ++s) {
      const double value = valueOf(rows, s);
      std::memcpy(record_.data() + sizeof head + s * sizeof value, &value, sizeof value);
    }
    SURFEIT_RETURN_IF_ERROR(cells_->add(record_.data()));
  }
  return {};
}

Status GridThinner::choose(const Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(cells_->finish());
  std::vector<std::byte> first(sizeof(CellHead) + sums_.size() * sizeof(double));
  while (cells_->current() != nullptr) {
    // The first of a cell is the one to keep
    std::memcpy(first.data(), cells_->current(), first.size());
    const CellHead head = headOf<CellHead>(first.data());
    std::fill(totals_.begin(), totals_.end(), 0);
    std::uint64_t count = 0;
    while (cells_->current() != nullptr && headOf<CellHead>(cells_->current()).isSameCell(head)) {
      if (count++ % kRowsPerLook == 0 && progress.isCancelled()) return Status::interrupted();
      for (std::size_t s = 0; s < totals_.size(); ++s) {
        totals_[s] += numberAt(cells_->current() + sizeof(CellHead), s);
      }
      SURFEIT_RETURN_IF_ERROR(cells_->advance());
    }
    SURFEIT_RETURN_IF_ERROR(addPick(first.data(), count));
  }
  cells_.reset();
  return picks_->finish();
}

// The row of a cell's first record, which stands for `count` of them.
Status GridThinner::addPick(const std::byte* first, std::uint64_t count) {
  PickHead pick;
  pick.row = __builtin_bswap64(headOf<CellHead>(first).row);
  pick.count = count;
  double ratio = double(count);
  if (area_) {
    const double own = numberAt(first + sizeof(CellHead), *area_);
    if (own > 0 && totals_[*area_] > 0) ratio = totals_[*area_] / own;
  }
  pick.growth = std::sqrt(ratio);
  record_.resize(sizeof pick + totals_.size() * sizeof(double));
  std::memcpy(record_.data(), &pick, sizeof pick);
  if (!totals_.empty()) {
    std::memcpy(record_.data() + sizeof pick, totals_.data(), totals_.size() * sizeof(double));
  }
  ++kept_;
  return picks_->add(record_.data());
}

// Makes a row stand for its cell.
void GridThinner::stand(std::byte* row, const std::byte* pick) const {
  const PickHead head = headOf<PickHead>(pick);
  if (head.count == 1) return;
  for (std::size_t s = 0; s < sums_.size(); ++s) {
    const double sum = numberAt(pick + sizeof head, s);
    if (area_ != s || sum > 0) store(sum, sums_[s], row);
  }
  for (const RowProperty& length : lengths_) {
    store(rowValue(row + length.offset, length.type) * head.growth, length, row);
  }
}

Result<std::size_t> GridThinner::thin(std::byte* rows, std::size_t count) {
  std::size_t size = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t number = next_row_++;
    const std::byte* const pick = picks_->current();
    if (pick == nullptr || headOf<PickHead>(pick).row != number) continue;
    std::byte* const to = rows + size++ * row_bytes_;
    if (to != rows + i * row_bytes_) std::memcpy(to, rows + i * row_bytes_, row_bytes_);
    stand(to, pick);
    SURFEIT_RETURN_IF_ERROR(picks_->advance());
  }
  return size;
}

}  // namespace surfeit
