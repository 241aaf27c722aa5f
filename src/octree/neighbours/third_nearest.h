// How far places are from each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "octree/neighbours/surface_cell.h"

namespace surfeit {

// How far some places are from the third nearest of others, since scans come in pairs.
class ThirdNearest {
 public:
  // The median; lengths in `unit`. Places may be among the others.
  float median(std::span<const Neighbour> places, std::span<const Neighbour> others, float unit) {
    const std::size_t count = others.size();
    for (std::vector<float>* column : {&x_, &y_, &z_, &squares_}) column->resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec3 offset = others[i].offset / unit;
      x_[i] = offset.x, y_[i] = offset.y, z_[i] = offset.z;
    }
    thirds_.clear();
    for (const Neighbour& place : places) thirds_.push_back(thirdSquare(place.offset / unit));
    const auto middle = thirds_.begin() + std::ptrdiff_t(thirds_.size() / 2);
    std::nth_element(thirds_.begin(), middle, thirds_.end());
    return std::sqrt(*middle) * unit;
  }

 private:
  float thirdSquare(const glm::vec3& from) {
    for (std::size_t j = 0; j < squares_.size(); ++j) {
      const float dx = x_[j] - from.x, dy = y_[j] - from.y, dz = z_[j] - from.z;
      squares_[j] = dx * dx + dy * dy + dz * dz;
    }
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    float least[3] = {kInfinity, kInfinity, kInfinity};
    for (const float square : squares_) {
      if (square >= least[2] || square == 0) continue;
      least[2] = square;
      if (least[2] < least[1]) std::swap(least[1], least[2]);
      if (least[1] < least[0]) std::swap(least[0], least[1]);
    }
    return least[2];
  }

  std::vector<float> x_, y_, z_, squares_, thirds_;
};

}  // namespace surfeit
