// Pictures of environments as texels on the sphere.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "gather/environment_grid.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Radiances on a LatLongGrid, or a CubeGrid in the frame of gather/environment_map.h.
struct EnvironmentPicture {
  std::unique_ptr<SphereGrid> grid;
  std::vector<glm::vec3> texels;
  int columns = 0;      // around the horizon
  glm::dvec3 power{0};  // integral over the sphere
};

// Reads one, reduced to EnvironmentMap::kMaxColumns and kMaxFaceEdge; errors as
// EnvironmentMap::load.
Result<EnvironmentPicture> readEnvironmentPicture(const std::string& path, Progress& progress);

}  // namespace surfeit
