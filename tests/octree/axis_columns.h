#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "octree/page/column_codec.h"

namespace surfeit {

// Vectors as the columns of their axes.
struct AxisColumns {
  explicit AxisColumns(std::size_t count) {
    for (std::vector<float>& axis : values) axis.resize(count);
  }
  explicit AxisColumns(std::span<const glm::vec3> vectors) : AxisColumns(vectors.size()) {
    for (std::size_t i = 0; i < vectors.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        values[axis][i] = vectors[i][static_cast<int>(axis)];
      }
    }
  }
  Axes axes() const { return {values[0], values[1], values[2]}; }
  MutableAxes mutableAxes() { return {values[0], values[1], values[2]}; }
  std::array<std::vector<float>, 3> values;
};

}  // namespace surfeit
