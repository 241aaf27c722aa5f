#include "index/notes/radius_note.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "octree/page/surfel_marks.h"

namespace surfeit {
namespace {

constexpr std::size_t kMostPlaces = 8192, kMostAsked = 256, kNeighbours = 8;
constexpr double kFactor = 100;

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Of the places that the sample has, as on a surface: each has a square of that edge.
double spacingOf(const std::vector<glm::vec3>& places) {
  std::vector<double> spacings;
  std::vector<float> distances;
  const std::size_t step = places.size() / kMostAsked + 1;
  for (std::size_t i = 0; i < places.size(); i += step) {
    distances.clear();
    for (const glm::vec3& other : places) {
      const glm::vec3 to = other - places[i];
      const float distance = glm::dot(to, to);
      if (distance > 0) distances.push_back(distance);  // repeats are no neighbours
    }
    if (distances.size() < kNeighbours) continue;
    const auto eighth = distances.begin() + (kNeighbours - 1);
    std::nth_element(distances.begin(), eighth, distances.end());
    spacings.push_back(std::sqrt(std::numbers::pi * double(*eighth) / kNeighbours));
  }
  return spacings.empty() ? 0 : median(spacings);
}

}  // namespace

std::string noteOfRadii(std::span<const Surfel> sample, std::uint64_t count,
                        const SizeNames& names) {
  std::vector<glm::vec3> places;
  std::vector<double> radii;
  const std::size_t step = sample.size() / kMostPlaces + 1;
  for (std::size_t i = 0; i < sample.size(); i += step) {
    const Surfel& surfel = sample[i];
    places.push_back(surfel.position);
    if (surfel.radius == kPlaceholderSize) return {};
    if (surfel.radius > 0) {
      radii.push_back(double(surfel.radius));
    } else if (surfel.area > 0) {
      radii.push_back(std::sqrt(double(surfel.area) / std::numbers::pi));
    }
  }
  if (radii.empty() || names.property.empty()) return {};
  const double spacing = spacingOf(places) * std::sqrt(double(places.size()) / double(count));
  const double radius = median(radii), ratio = radius / spacing;
  if (!(spacing > 0) || !std::isfinite(ratio) || (ratio < kFactor && ratio > 1 / kFactor))
    return {};

  // Radii are about half of a spacing as a rule
  const double power = std::round(std::log10(2 * ratio));
  std::string sets;
  if (names.property != "area") {
    sets = fmt::format(" --set \"{} *= 1e{:+.0f}\"", names.property, -power);
  }
  if (names.has_area) sets += fmt::format(" --set \"area *= 1e{:+.0f}\"", -2 * power);
  return fmt::format(
      "half of the radii are {} {:.3g}, and neighbours lie about {:.3g} apart: if sizes have "
      "another "
      "unit than places, convert{} gives them that of the places{}",
      ratio > 1 ? "above" : "below", radius, spacing, sets,
      names.drops.empty()
          ? ""
          : fmt::format("; --channels {} lets index find them from the neighbours", names.drops));
}

std::string noteOfGaps(std::span<const Surfel> sample, const SizeNames& names) {
  // The thinnest covering of a plane by equal disks (Kershner 1939, "The Number of Circles Covering
  // a Set")
  const double thinnest = 2 * std::numbers::pi / std::sqrt(27.);
  std::vector<double> parts;
  for (const Surfel& surfel : sample) {
    const bool is_tile = !surfel.isSphere() && !surfel.isTwoSided() && surfel.transparency == 0 &&
                         surfel.long_side == 0;
    if (!is_tile || !(surfel.radius > 0 && surfel.area > 0)) continue;
    if (surfel.radius == kPlaceholderSize) continue;
    const double radius = double(surfel.radius);
    parts.push_back(std::numbers::pi * radius * radius / double(surfel.area));
  }
  if (parts.empty()) return {};
  const double part = median(parts);
  if (part >= thinnest) return {};
  return fmt::format(
      "half of the disks or more have pi r^2 below 1.21 of their areas, {:.2f} at the median: such "
      "disks leave gaps however they lie, and light passes. Larger radii close them{}",
      part,
      names.drops.empty()
          ? ""
          : fmt::format("; --channels {} lets index find sizes from the neighbours", names.drops));
}

}  // namespace surfeit
