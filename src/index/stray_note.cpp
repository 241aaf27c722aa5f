#include "index/stray_note.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

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

// The bounds of 98 % where the others are strays; else nothing.
std::optional<Bounds3d> boundsBesideStrays(std::vector<glm::vec3>& sample, const Bounds3& bounds) {
  if (sample.size() < kRare) return std::nullopt;
  const Bounds3d usual = usualBounds(sample);
  const double width = usual.longestSide();
  if (!(width > 0) || double(bounds.longestSide()) <= kFar * width) return std::nullopt;
  return usual;
}

}  // namespace

std::string strayNote(std::vector<glm::vec3> sample, const Bounds3& bounds,
                      const glm::dvec3& origin) {
  const std::optional<Bounds3d> found = boundsBesideStrays(sample, bounds);
  if (!found) return {};
  Bounds3d usual = *found;
  const double width = usual.longestSide(), whole = double(bounds.longestSide());
  // With as much room on every side
  usual.min += origin - width;
  usual.max += origin + width;
  return fmt::format(
      "strays: the cloud is {:.2g} times as wide as the box that holds 98 % of it. If those are "
      "errors, leave them out: surfeit convert CLOUD -o CLEAN --crop "
      "{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}",
      whole / width, usual.min.x, usual.min.y, usual.min.z, usual.max.x, usual.max.y, usual.max.z);
}

std::string lossByStrays(std::vector<glm::vec3> sample, const Bounds3& bounds,
                         const glm::dvec3& origin, std::uint64_t count, bool is_origin_asked) {
  const std::optional<Bounds3d> usual = boundsBesideStrays(sample, bounds);
  if (!usual) return {};
  const double step = floatStep(*usual);
  const double spacing = usual->longestSide() / std::sqrt(double(count));
  if (step <= 1e-3 * spacing) return {};
  const glm::dvec3 middle = usual->centre() + origin;
  const std::string choice =
      fmt::format(", or give --origin {:.0f},{:.0f},{:.0f}", middle.x, middle.y, middle.z);
  return fmt::format(
      "positions are rounded to {:.2g}, beside a spacing of about {:.2g}, because strays put their "
      "origin far away: leave the strays out{}",
      step, spacing, is_origin_asked ? choice : "");
}

}  // namespace surfeit
