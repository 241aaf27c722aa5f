// From the values of a channel to what a picture shows.
#pragma once

#include <algorithm>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>

#include "core/bounds.h"
#include "surfeit/progress.h"
#include "view/channel.h"
#include "view/picture_file.h"

namespace surfeit {

// scale * value + offset.
struct ValueMap {
  glm::vec3 scale{1};
  glm::vec3 offset{0};
};

// Where a cloud is, and which finite values a channel takes.
struct ValueExtent {
  Bounds3d bounds;
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -std::numeric_limits<double>::infinity();

  void addValue(double value) {
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
  }
};

// Maps `range` to black and white where it is given. Otherwise OpenEXR keeps the channel's own
// values, and PNG shows light as it is, and numbers stretched over the values they take, of which a
// note tells.
ValueMap chooseValueMap(const std::optional<glm::dvec2>& range, const Channel& channel,
                        const ValueExtent& extent, PictureFormat format, Progress& progress);

}  // namespace surfeit
