// Rows become the points of a LAS file, as a plan (cloud/scans/las_plan.h) has them, and what its
// header says of all of them is gathered: bounds, counts by return, what does not fit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cloud/scans/las_plan.h"

namespace surfeit {

// How positions are stored: whole numbers of `scale`, from `origin`.
struct LasGrid {
  std::array<double, 3> scale{1, 1, 1}, origin{};
};

class LasEncoder {
 public:
  LasEncoder(LasPlan plan, const LasGrid& grid);

  const LasPlan& plan() const { return plan_; }
  const LasGrid& grid() const { return grid_; }

  // Appends the records of whole rows. kInvalidArgument, naming `path` and the row, when a position
  // lies off the grid; one that is not finite becomes a withheld point.
  Status encode(const std::byte* rows, std::size_t row_bytes, std::size_t count,
                const std::string& path, std::vector<std::byte>& records);

  std::uint64_t count() const { return count_; }
  std::array<double, 3> least() const { return boundOf(least_); }
  std::array<double, 3> most() const { return boundOf(most_); }
  // By number of the return, from 1.
  const std::array<std::uint64_t, 15>& returns() const { return returns_; }
  // What became of values that do not fit, one sentence each.
  std::vector<std::string> notes() const;

 private:
  std::array<double, 3> boundOf(const std::array<std::int32_t, 3>& stored) const;
  Status encodePosition(const std::byte* row, const std::string& path, std::byte* record);
  void countReturn(std::byte* record);

  LasPlan plan_;
  LasGrid grid_;
  std::uint64_t count_ = 0;
  std::array<std::int32_t, 3> least_, most_, last_{};
  std::array<std::uint64_t, 15> returns_{};
  std::vector<std::uint64_t> misfits_, no_numbers_;  // by column
  std::vector<double> changes_;                      // by column, of scaled values
  std::uint64_t without_position_ = 0;
  double largest_move_ = 0, largest_value_ = 0;
};

// Whether values of such a column, which `count` rows have, are what a file would hold: the number
// itself, or of scaled ones the nearest step.
bool keepsLasValues(const LasColumn& column, const std::byte* rows, std::size_t row_bytes,
                    std::size_t count);

// The grid for so many positions between these bounds: powers of ten, a tenth of a millimetre where
// the unit is metres, finer for small clouds, coarser where 32 bits ask for it. `is_float`: whether
// positions are floats, whose digits end at 24 bits.
LasGrid chooseLasGrid(const std::array<double, 3>& least, const std::array<double, 3>& most,
                      std::uint64_t count, bool is_float);

}  // namespace surfeit
