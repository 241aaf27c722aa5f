#include "brick/brick_sweep.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace surfeit {

std::uint64_t brickMorton(const std::array<std::uint32_t, 3>& cell) {
  std::uint64_t key = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Two zeros between every two of 21 bits
    std::uint64_t bits = cell[axis] & 0x1FFFFF;
    bits = (bits | bits << 32) & 0x001F00000000FFFF;
    bits = (bits | bits << 16) & 0x001F0000FF0000FF;
    bits = (bits | bits << 8) & 0x100F00F00F00F00F;
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3;
    bits = (bits | bits << 2) & 0x1249249249249249;
    key |= bits << axis;
  }
  return key;
}

std::array<std::uint32_t, 3> brickCell(std::uint64_t morton) {
  std::array<std::uint32_t, 3> cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::uint64_t bits = morton >> axis & 0x1249249249249249;
    bits = (bits | bits >> 2) & 0x10C30C30C30C30C3;
    bits = (bits | bits >> 4) & 0x100F00F00F00F00F;
    bits = (bits | bits >> 8) & 0x001F0000FF0000FF;
    bits = (bits | bits >> 16) & 0x001F00000000FFFF;
    bits = (bits | bits >> 32) & 0x1FFFFF;
    cell[axis] = static_cast<std::uint32_t>(bits);
  }
  return cell;
}

BrickSweep::BrickSweep(std::size_t value_count, int top_level, double max_error, Emit emit)
    : value_count_(value_count),
      top_level_(top_level),
      max_error_(max_error),
      emit_(std::move(emit)),
      cells_(static_cast<std::size_t>((top_level + 1) * kBrickDirections)),
      mean_(value_count) {
  for (Cell& each : cells_) {
    each.sums.resize(value_count);
    each.direct_sums.resize(value_count);
    each.low.resize(value_count);
    each.high.resize(value_count);
    each.child_values.resize(8 * value_count);
  }
}

Status BrickSweep::add(std::uint64_t morton, const BrickPoint& point,
                       std::span<const float> values) {
  if (has_point_ && morton != morton_) {
    const int highest_bit = 63 - std::countl_zero(morton ^ morton_);
    SURFEIT_RETURN_IF_ERROR(closeTo(std::min(highest_bit / 3, top_level_)));
  }
  morton_ = morton;
  has_point_ = true;
  const int level = std::min(point.level, top_level_);
  const std::array<float, kBrickDirections> shares = directionWeights(point.normal);
  for (int direction = 0; direction < kBrickDirections; ++direction) {
    const double weight = static_cast<double>(point.weight) *
                          static_cast<double>(shares[static_cast<std::size_t>(direction)]);
    if (!(weight > 0)) continue;
    Cell& open = cell(level, direction);
    active_[static_cast<std::size_t>(level)] |= 1u << direction;
    open.direct_weight += weight;
    for (std::size_t i = 0; i < value_count_; ++i) {
      open.direct_sums[i] += weight * static_cast<double>(values[i]);
    }
  }
  return {};
}

Status BrickSweep::finish() { return has_point_ ? closeTo(top_level_) : Status(); }

// Closes the open cells of levels 0 to `level`.
Status BrickSweep::closeTo(int level) {
  for (int each = 0; each <= level; ++each) {
    for (int direction = 0; direction < kBrickDirections; ++direction) {
      if ((active_[static_cast<std::size_t>(each)] >> direction & 1) == 0) continue;
      SURFEIT_RETURN_IF_ERROR(close(each, direction));
    }
    active_[static_cast<std::size_t>(each)] = 0;
  }
  return {};
}

void BrickSweep::extend(Cell& cell, std::span<const float> low, std::span<const float> high) const {
  for (std::size_t i = 0; i < value_count_; ++i) {
    cell.low[i] = cell.has_range ? std::min(cell.low[i], low[i]) : low[i];
    cell.high[i] = cell.has_range ? std::max(cell.high[i], high[i]) : high[i];
  }
  cell.has_range = true;
}

bool BrickSweep::differs(const Cell& cell) const {
  // Without a tolerance everything is kept, also what is equal
  if (max_error_ == 0) return true;
  for (std::size_t i = 0; i < value_count_; ++i) {
    if (static_cast<double>(cell.high[i]) - static_cast<double>(cell.low[i]) > max_error_) {
      return true;
    }
  }
  return false;
}

Status BrickSweep::emitChildren(const Cell& parent, int level, int direction) {
  const std::uint64_t above = morton_ >> (3 * level) << 3;
  for (std::size_t i = 0; i < parent.child_count; ++i) {
    const BrickVoxel voxel{level - 1, direction, brickCell(above | parent.child_place[i]),
                           parent.child_weight[i],
                           std::span(parent.child_values).subspan(i * value_count_, value_count_)};
    SURFEIT_RETURN_IF_ERROR(emit_(voxel));
  }
  return {};
}

// The cell is complete: its children are kept or not, and it becomes a child itself.
Status BrickSweep::close(int level, int direction) {
  Cell& done = cell(level, direction);
  if (done.direct_weight > 0) {
    for (std::size_t i = 0; i < value_count_; ++i) {
      mean_[i] = static_cast<float>(done.direct_sums[i] / done.direct_weight);
      done.sums[i] += done.direct_sums[i];
    }
    extend(done, mean_, mean_);
    done.weight += done.direct_weight;
  }
  if (done.child_count > 0 && differs(done)) {
    SURFEIT_RETURN_IF_ERROR(emitChildren(done, level, direction));
  }
  for (std::size_t i = 0; i < value_count_; ++i) {
    mean_[i] = static_cast<float>(done.sums[i] / done.weight);
  }
  if (level == top_level_) {
    const BrickVoxel voxel{level, direction, brickCell(morton_ >> (3 * level)),
                           static_cast<float>(done.weight), mean_};
    SURFEIT_RETURN_IF_ERROR(emit_(voxel));
  } else {
    Cell& parent = cell(level + 1, direction);
    active_[static_cast<std::size_t>(level + 1)] |= 1u << direction;
    const std::size_t child = parent.child_count++;
    parent.child_place[child] = static_cast<std::uint8_t>(morton_ >> (3 * level) & 7);
    parent.child_weight[child] = static_cast<float>(done.weight);
    std::copy(mean_.begin(), mean_.end(),
              parent.child_values.begin() + static_cast<std::ptrdiff_t>(child * value_count_));
    extend(parent, done.low, done.high);
    parent.weight += done.weight;
    for (std::size_t i = 0; i < value_count_; ++i) parent.sums[i] += done.sums[i];
  }
  done.weight = done.direct_weight = 0;
  done.has_range = false;
  done.child_count = 0;
  std::fill(done.sums.begin(), done.sums.end(), 0.0);
  std::fill(done.direct_sums.begin(), done.direct_sums.end(), 0.0);
  return {};
}

}  // namespace surfeit
