#include "index/steps/pinned_cube.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/surfel_limits.h"

namespace surfeit {
namespace {

std::string numbersOf(const glm::dvec3& corner, double size) {
  return fmt::format("{},{},{},{}", corner.x, corner.y, corner.z, size);
}

std::string placeOf(const glm::dvec3& place) {
  return fmt::format("{:.9g} {:.9g} {:.9g}", place.x, place.y, place.z);
}

}  // namespace

Status PinnedCube::check(const SceneCube& cube) {
  const double most = double(kLargestLength);
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(cube.corner[axis]) <= most) continue;
    return Status::invalidArgument(
        fmt::format("cube: corner {}, expected a number of at most 1e12", cube.corner[axis]));
  }
  if (!(cube.size > 0 && cube.size <= most)) {
    return Status::invalidArgument(
        fmt::format("cube: size {}, expected a number above 0, at most 1e12", cube.size));
  }
  // The cells of the finest level must differ in doubles
  const glm::dvec3 far = glm::abs(cube.corner);
  if (cube.size < 1e-9 * std::max({far.x, far.y, far.z})) {
    return Status::invalidArgument(
        fmt::format("cube: size {} at {} is too small to be divided, expected at least a "
                    "billionth of the coordinates",
                    cube.size, placeOf(cube.corner)));
  }
  return {};
}

glm::dvec3 PinnedCube::origin() const { return originFor(box()); }

RootCube PinnedCube::about(const glm::dvec3& origin) const {
  const glm::dvec3 corner = cube_.corner - origin;
  return {{corner.x, corner.y, corner.z}, cube_.size};
}

std::optional<std::array<double, 4>> PinnedCube::unusualNumbers(const Bounds3& bounds,
                                                                const glm::dvec3& origin) const {
  if (about(origin) == rootCube(bounds)) return std::nullopt;
  return std::array<double, 4>{cube_.corner.x, cube_.corner.y, cube_.corner.z, cube_.size};
}

void PinnedCube::look(std::span<const Surfel> surfels, const Bounds3& bounds,
                      const glm::dvec3& origin) {
  const RootCube cube = about(origin);
  if (contains(cube, bounds)) return;
  outside_ += static_cast<std::uint64_t>(
      std::count_if(surfels.begin(), surfels.end(), [&](const Surfel& surfel) {
        return !contains(cube, {surfel.position, surfel.position});
      }));
}

Status PinnedCube::status(std::uint64_t surfels, const Bounds3& bounds,
                          const glm::dvec3& origin) const {
  if (outside_ == 0) return {};
  const Bounds3d found = movedBounds(bounds, origin);
  Bounds3d all = box();
  all.add(found);
  const RootCube holds = rootCube(all);
  return Status::invalidArgument(fmt::format(
      "{} of {} surfels lie outside of the cube {}: surfels reach from {} to {}. Index every scene "
      "of the sequence with one cube that holds all: --cube {}",
      outside_.load(), surfels, numbersOf(cube_.corner, cube_.size), placeOf(found.min),
      placeOf(found.max),
      numbersOf({holds.origin[0], holds.origin[1], holds.origin[2]}, holds.size)));
}

}  // namespace surfeit
