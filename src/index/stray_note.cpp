#include "index/stray_note.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

namespace surfeit {
namespace {

constexpr double kFar = 1000;
// A hundredth of the sample at either end of each axis may be strays.
constexpr std::size_t kRare = 100;

Bounds3d usualBounds(std::vector<glm::vec3>& sample) {
  Bounds3d bounds;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t rare = sample.size() / kRare;
    const auto low = sample.begin() + static_cast<std::ptrdiff_t>(rare);
    const auto high = sample.end() - static_cast<std::ptrdiff_t>(rare) - 1;
    const auto less = [axis](const glm::vec3& a, const glm::vec3& b) { return a[axis] < b[axis]; };
    std::nth_element(sample.begin(), low, sample.end(), less);
    bounds.min[axis] = double((*low)[axis]);
    std::nth_element(sample.begin(), high, sample.end(), less);
    bounds.max[axis] = double((*high)[axis]);
  }
  return bounds;
}

}  // namespace

std::string strayNote(std::vector<glm::vec3> sample, const Bounds3& bounds,
                      const glm::dvec3& origin) {
  if (sample.size() < kRare) return {};
  Bounds3d usual = usualBounds(sample);
  const double width = usual.longestSide(), whole = double(bounds.longestSide());
  if (!(width > 0) || whole <= kFar * width) return {};
  // With as much room on every side
  usual.min += origin - width;
  usual.max += origin + width;
  return fmt::format(
      "strays: the cloud is {:.2g} times as wide as the box that holds 98 % of it. If those are "
      "errors, leave them out: surfeit convert CLOUD -o CLEAN --crop "
      "{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}",
      whole / width, usual.min.x, usual.min.y, usual.min.z, usual.max.x, usual.max.y, usual.max.z);
}

}  // namespace surfeit
