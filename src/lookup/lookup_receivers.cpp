#include "lookup/lookup_receivers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "cloud/rows/surfel_names.h"

namespace surfeit {
namespace {

// Takes the three properties of a channel as those of position or normal.
Status takeTriple(const RowLayout& element, const std::string& path, const std::string& channel,
                  const char* option, const char* const (&names)[3], RowLayout& geometry) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name = channel + "_" + "xyz"[axis];
    const RowProperty* const found = element.find(name);
    if (found == nullptr || found->is_list) {
      return Status::invalidArgument(
          fmt::format("{}: no property {}, expected {}_x {}_y {}_z ({} {})", path, name, channel,
                      channel, channel, option, channel));
    }
    geometry.properties.push_back(*found);
    geometry.properties.back().name = names[axis];
  }
  return {};
}

void takeNamed(const RowLayout& element, const char* const (&names)[3], RowLayout& geometry) {
  for (const char* const name : names) {
    const RowProperty* const found = element.find(name);
    if (found != nullptr) geometry.properties.push_back(*found);
  }
}

}  // namespace

SpaceMap SpaceMap::of(const LookupMatrix& m) {
  SpaceMap map;
  for (int row = 0; row < 3; ++row) {
    const auto at = static_cast<std::size_t>(4 * row);
    for (int column = 0; column < 3; ++column) {
      map.linear[column][row] = m[at + static_cast<std::size_t>(column)];
    }
    map.translation[row] = m[at + 3];
  }
  return map;
}

SpaceMap SpaceMap::after(const SpaceMap& first) const {
  return {linear * first.linear, at(first.translation)};
}

SpaceMap SpaceMap::inverse() const {
  const glm::dmat3 back = glm::inverse(linear);
  return {back, -(back * translation)};
}

LookupMatrix SpaceMap::matrix() const {
  LookupMatrix m;
  for (int row = 0; row < 3; ++row) {
    const auto at = static_cast<std::size_t>(4 * row);
    for (int column = 0; column < 3; ++column) {
      m[at + static_cast<std::size_t>(column)] = linear[column][row];
    }
    m[at + 3] = translation[row];
  }
  return m;
}

Status checkSpace(const LookupMatrix& matrix, const char* name) {
  for (const double number : matrix) {
    if (std::isfinite(number)) continue;
    return Status::invalidArgument(
        fmt::format("{}: found {}, expected numbers that are finite", name, number));
  }
  const SpaceMap map = SpaceMap::of(matrix);
  double lengths = 1;
  for (int axis = 0; axis < 3; ++axis) lengths *= glm::length(map.linear[axis]);
  const double volume = std::abs(glm::determinant(map.linear));
  if (volume > 1e-12 * lengths && std::isfinite(1 / volume)) return {};
  return Status::invalidArgument(
      fmt::format("{}: the matrix has no inverse: it makes space flat", name));
}

LookupReceivers::LookupReceivers(SurfelMapping surfels, const SpaceMap& to_map)
    : surfels_(std::move(surfels)),
      to_map_(to_map),
      normal_to_map_(glm::transpose(glm::inverse(to_map.linear))) {}

Result<LookupReceivers> LookupReceivers::create(const RowLayout& element, const std::string& path,
                                                const LookupOptions& options) {
  RowLayout geometry = element;
  geometry.properties.clear();
  if (options.reference_positions.empty()) {
    takeNamed(element, kPositionNames, geometry);
  } else {
    SURFEIT_RETURN_IF_ERROR(
        takeTriple(element, path, options.reference_positions, "--pref", kPositionNames, geometry));
  }
  if (!options.reference_normals.empty()) {
    SURFEIT_RETURN_IF_ERROR(
        takeTriple(element, path, options.reference_normals, "--nref", kNormalNames, geometry));
  } else if (options.reference_positions.empty()) {
    takeNamed(element, kNormalNames, geometry);
  }
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping surfels, SurfelMapping::create(geometry, path));
  const SpaceMap to_map =
      SpaceMap::of(options.to_space).after(SpaceMap::of(options.from_space).inverse());
  return LookupReceivers(std::move(surfels), to_map);
}

bool LookupReceivers::decode(const std::byte* row, std::uint64_t record, Place& place,
                             SurfelDefects& defects) const {
  Surfel surfel;
  if (!surfels_.decode(row, record, surfel, defects)) return false;
  place.position = to_map_.at(surfels_.positionOf(row));
  const glm::dvec3 normal = normal_to_map_ * glm::dvec3(surfel.normal);
  const double length = glm::length(normal);
  place.normal = length > 0 ? glm::vec3(normal / length) : glm::vec3(0);
  return true;
}

}  // namespace surfeit
