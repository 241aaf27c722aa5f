#include "index/steps/scene_place.h"

#include "index/steps/pinned_cube.h"

namespace surfeit {

glm::dvec3 originAsked(const IndexOptions& options, const Bounds3& bounds,
                       const glm::dvec3& present) {
  if (options.origin) return *options.origin;
  if (options.cube) return PinnedCube(*options.cube).origin();
  return originFor(movedBounds(bounds, present));
}

RootCube cubeAsked(const IndexOptions& options, const Bounds3& bounds, const glm::dvec3& origin) {
  return options.cube ? PinnedCube(*options.cube).about(origin) : rootCube(bounds);
}

}  // namespace surfeit
