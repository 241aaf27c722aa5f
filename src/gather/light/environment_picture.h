// Pictures of environments as texels on the sphere.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gather/light/environment_grid.h"
#include "surfeit/status.h"

namespace surfeit {

// Radiances on a LatLongGrid, or a CubeGrid in the frame of gather/light/environment_map.h.
struct EnvironmentPicture {
  // Larger pictures are reduced to this as they are read, each pixel by its solid angle: 3 mrad, a
  // third of the sun. Lat-long columns; pixels along the edge of a cube's face.
  static constexpr int kMaxColumns = 2048;
  static constexpr int kMaxFaceEdge = 512;

  std::unique_ptr<SphereGrid> grid;
  std::vector<glm::vec3> texels;
  int columns = 0;      // around the horizon
  glm::dvec3 power{0};  // integral over the sphere
};

// Gives the rows of a picture, top to bottom: radiances, finite and not negative.
using LightRows = std::function<Result<std::span<const glm::vec3>>()>;

// A picture from its rows: lat-long, which must be twice as wide as high, or an OpenEXR cube map,
// six times as high as wide. `path` names it in messages. kInvalidArgument for another shape, and
// for cubes too large to be reduced; else the errors of the rows.
Result<EnvironmentPicture> environmentPicture(int width, int height, bool is_cube_map,
                                              const LightRows& next, const std::string& path);

}  // namespace surfeit
