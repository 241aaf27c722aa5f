// Points in the order of a Morton curve become the voxels of all levels, bottom-up in one sweep: a
// cell of any level is a run of the curve, so that at most one cell per level is open, with at most
// 8 children that wait for it to decide whether they are kept.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "brick/brick_layout.h"
#include "surfeit/status.h"

namespace surfeit {

// [z : 1 | y : 1 | x : 1] for each of 21 bits.
std::uint64_t brickMorton(const std::array<std::uint32_t, 3>& cell);
std::array<std::uint32_t, 3> brickCell(std::uint64_t morton);

struct BrickPoint {
  int level = 0;  // the finest that it is fine enough for
  float weight = 1;
  glm::vec3 normal{0};  // unit, or zero
};

struct BrickVoxel {
  int level = 0, direction = 0;
  std::array<std::uint32_t, 3> cell = {};  // of its level
  float weight = 0;                        // area times share of the direction
  std::span<const float> values;
};

// One thread at a time.
class BrickSweep {
 public:
  using Emit = std::function<Status(const BrickVoxel&)>;
  // Levels 0 to top_level; all voxels of that one are kept, of the others those whose parent holds
  // values that differ by more than max_error. `emit` takes them in no order.
  BrickSweep(std::size_t value_count, int top_level, double max_error, Emit emit);

  // In rising order of `morton`, which is of level 0.
  Status add(std::uint64_t morton, const BrickPoint& point, std::span<const float> values);
  Status finish();

 private:
  // What is known of a cell of a level and direction.
  struct Cell {
    double weight = 0, direct_weight = 0;
    bool has_range = false;
    std::vector<double> sums, direct_sums;  // values times weights; of points of this level alone
    std::vector<float> low, high;           // of the finest voxels within
    // Children: place in the cell (0 to 7), weights, values
    std::size_t child_count = 0;
    std::array<std::uint8_t, 8> child_place = {};
    std::array<float, 8> child_weight = {};
    std::vector<float> child_values;
  };

  Cell& cell(int level, int direction) {
    return cells_[static_cast<std::size_t>(level * kBrickDirections + direction)];
  }
  Status closeTo(int level);
  Status close(int level, int direction);
  void extend(Cell& cell, std::span<const float> low, std::span<const float> high) const;
  bool differs(const Cell& cell) const;
  Status emitChildren(const Cell& cell, int level, int direction);

  std::size_t value_count_;
  int top_level_;
  double max_error_;
  Emit emit_;
  std::vector<Cell> cells_;
  std::array<std::uint32_t, kMostBrickLevels> active_ = {};  // directions of each level's open cell
  bool has_point_ = false;
  std::uint64_t morton_ = 0;  // of the last point
  std::vector<float> mean_;
};

}  // namespace surfeit
