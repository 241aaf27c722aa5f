// Thins rows to an even density, or to one for cameras: one of every cell of a grid is kept, and
// stands for all of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cloud/rows/row_layout.h"
#include "storage/external_sorter.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfels/camera_spacing.h"

namespace surfeit {

// Rows go past twice in the same order: measure() sees all, choose() picks, thin() keeps the picks.
// Of each cell the row nearest to the middle is kept, of rows as near the first. Areas and powers
// of a cell are summed into it; radii grow by the root of the ratio of the areas, of the count
// where there is no area; all else is that of the kept row. Cells are cubes counted from 0, so that
// clouds that are thinned by themselves share one grid. With cameras there is a grid for every
// power of two, and a row lies in the one with cells nearest to the root of the area that the
// cameras allow at its place: rows of different grids are never merged, so a camera that moves
// changes only the cells that change their grid. What the memory does not hold is sorted in
// temporary files, and the result does not depend on it. One thread at a time; sorts with the
// threads of the arena.
class GridThinner {
 public:
  static constexpr std::uint64_t kLeastMemory = 2 * ExternalSorter::kLeastMemory;

  struct Options {
    double spacing = 0;  // edge of a cell; finite, above 0; without meaning with cameras
    std::optional<CameraSpacing> cameras{};
    std::uint64_t memory_bytes = 0;  // at least kLeastMemory
    std::string temporary_directory;
  };

  // For packed rows of `element`, whose sizes and powers are floats
  // (RowTransform::widenSizes). kInvalidArgument when rows have no positions.
  static Result<std::unique_ptr<GridThinner>> create(Options options, const RowLayout& element);
  // kInvalidArgument for a spacing that is none.
  static Status checkSpacing(double spacing);

  // kInvalidArgument when a position is 2^53 cells or more away from 0; kIoError of temporary
  // files.
  Status measure(const std::byte* rows, std::size_t count);
  Status choose(const Progress& progress);
  // Moves the rows that are kept to the front, as what they stand for, and returns how many.
  Result<std::size_t> thin(std::byte* rows, std::size_t count);
  // Whether every pick came: not when the rows were fewer the second time.
  bool isComplete() const { return picks_->current() == nullptr; }

  std::uint64_t measured() const { return measured_; }
  std::uint64_t kept() const { return kept_; }
  // Rows without a finite position: none is kept.
  std::uint64_t placeless() const { return placeless_; }

 private:
  explicit GridThinner(Options options) : options_(std::move(options)) {}

  // Place of a row in the grid.
  struct Place {
    std::array<std::int64_t, 3> cell{};
    int grid = 0;            // with cameras: the exponent of the edge
    double distance_sq = 0;  // to the middle, in cells
  };
  // Absent where the position is not finite.
  Result<std::optional<Place>> placeOf(const std::byte* row) const;
  Status addPick(const std::byte* first, std::uint64_t count);
  void stand(std::byte* row, const std::byte* pick) const;
  double valueOf(const std::byte* row, std::size_t sum) const;
  ExternalSorter::Options sorting(std::size_t head_bytes) const;

  Options options_;
  std::size_t row_bytes_ = 0;
  std::array<RowProperty, 3> position_;
  std::vector<RowProperty> sums_, lengths_;
  std::optional<std::size_t> area_;  // among sums_
  std::optional<ExternalSorter> cells_, picks_;
  std::vector<std::byte> record_;
  std::vector<double> totals_;  // of a cell
  std::uint64_t measured_ = 0, placeless_ = 0, kept_ = 0;
  std::uint64_t next_row_ = 0;  // of the second time
};

}  // namespace surfeit
