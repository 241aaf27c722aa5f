#include "index/notes/stray_note.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <tuple>

namespace surfeit {
namespace {

constexpr double kFar = 1000;
// A hundredth of the sample at either end of each axis may be strays.
constexpr std::size_t kRare = 100;
// Part of the spacing that rounding may move positions by.
constexpr double kLoss = 0.02;
constexpr std::size_t kLeastInCell = 8;

// The bounds of 98 % where the others are strays; else nothing.
std::optional<Bounds3d> boundsBesideStrays(std::vector<glm::vec3>& sample, const Bounds3& bounds) {
  if (sample.size() < kRare) return std::nullopt;
  const Bounds3d usual = usualBounds(sample);
  const double width = usual.longestSide();
  if (!(width > 0) || double(bounds.longestSide()) <= kFar * width) return std::nullopt;
  return usual;
}

// Places from all over a sample, few enough to be sorted often.
std::vector<glm::vec3> fewPlaces(const std::vector<glm::vec3>& sample) {
  constexpr std::size_t kMost = 4096;
  const std::size_t step = sample.size() / kMost + 1;
  std::vector<glm::vec3> few(sample.size() / step);
  for (std::size_t i = 0; i < few.size(); ++i) few[i] = sample[i * step];
  return few;
}

// Whether most places repeat another one: then their spacing is not to be seen.
bool areRepeats(const std::vector<glm::vec3>& places) {
  std::set<std::tuple<float, float, float>> distinct;
  for (const glm::vec3& place : places) distinct.emplace(place.x, place.y, place.z);
  return distinct.size() * kLeastInCell <= places.size();
}

// The area that places cover, or more: of the finest cells of a grid that hold a good number each.
double coveredArea(const std::vector<glm::vec3>& places, const Bounds3& bounds) {
  constexpr int kLevels = 21;
  const double side = double(bounds.longestSide());
  std::vector<std::uint64_t> cells(places.size());
  double area = side * side;
  for (int level = 1; level < kLevels; ++level) {
    const double scale = double(1 << level) / side;
    for (std::size_t i = 0; i < places.size(); ++i) {
      std::uint64_t cell = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double offset = double(places[i][axis]) - double(bounds.min[axis]);
        cell = cell << kLevels | static_cast<std::uint64_t>(std::max(offset * scale, 0.));
      }
      cells[i] = cell;
    }
    std::sort(cells.begin(), cells.end());
    const auto count = std::unique(cells.begin(), cells.end()) - cells.begin();
    if (std::size_t(count) * kLeastInCell > places.size()) break;
    area = double(count) / (scale * scale);
  }
  return area;
}

}  // namespace

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

std::string lossByDistance(const std::vector<glm::vec3>& sample, const Bounds3& bounds,
                           const glm::dvec3& origin, std::uint64_t count) {
  const double side = double(bounds.longestSide());
  const std::vector<glm::vec3> places = fewPlaces(sample);
  if (places.size() < kRare || !(side > 0) || count == 0 || areRepeats(places)) return {};
  const double spacing = std::sqrt(coveredArea(places, bounds) / double(count));
  std::size_t coarse = 0;
  double most = 0;
  for (const glm::vec3& place : places) {
    const double step = floatStep({glm::dvec3(place), glm::dvec3(place)});
    if (step <= kLoss * spacing) continue;
    ++coarse;
    most = std::max(most, step);
  }
  if (coarse <= places.size() / kRare) return {};
  return fmt::format(
      "positions of {:.0f} % of the surfels are rounded to {:.2g}, beside a spacing of about "
      "{:.2g}, "
      "because the surfels lie up to {:.2g} apart, and the scene counts from {:.0f} {:.0f} {:.0f}: "
      "index places far from each other one by one, or move them together (convert --transform)",
      100. * double(coarse) / double(places.size()), most, spacing, side, origin.x, origin.y,
      origin.z);
}

}  // namespace surfeit
