// Light from all around, infinitely far away (memo 7.3, app note 3): a picture of it, its pixels on
// a raster cube, and lookups over cones. All three hold the same power to rounding, whatever small
// and bright there is.
//
// Values are in units of radiosity, as all light of the gather: pi times the radiance of the
// picture times the intensity. Under a constant environment of radiance L, what is open receives E
// = pi L.
//
// Orientation. A frame has axes A, B and up: the world's x, y and z, or z, x and y when y is up. In
// a lat-long picture the top row is up; its middle column looks along A, left of it comes B at a
// quarter of the width, at the left and right edges -A, at three quarters -B. So it shows what one
// sees from inside, not mirrored. With y up this is OpenEXR's lat-long map and with z up the usual
// one of z-up programs. Pixels are areas: the picture's edges, not the middles of its outer pixels,
// are the poles and -A (OpenEXR's own functions differ by up to half a pixel). A cube map is that
// of OpenEXR's ImfEnvmap.h, whose axes x, y and z are B, up and A. Rotation turns the environment
// from A to B, counterclockwise seen from above.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gather/light/environment_picture.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/raster_geometry.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Immutable, so threads may share it.
class EnvironmentMap {
 public:
  // `path` only names the picture in messages. kInvalidArgument for options out
  // of range and light that is too bright.
  static Result<EnvironmentMap> create(EnvironmentPicture picture,
                                       const EnvironmentPlacement& environment,
                                       const std::string& path);
  EnvironmentMap(EnvironmentMap&&) noexcept;
  EnvironmentMap& operator=(EnvironmentMap&&) noexcept;
  ~EnvironmentMap();

  // Mean over about `solid_angle` (steradians) around a unit direction of the world: a smooth
  // weight without edges, which sums to the same for every part of the sphere. Down to 2.7e-5 with
  // pictures of 2048 columns, where smaller ones are the same. Safe from any thread.
  glm::vec3 lookup(const glm::vec3& direction, float solid_angle) const;

  // Mean over the sphere.
  glm::vec3 mean() const;
  // Bytes that the map holds: 10 MB for a picture of 1024 columns, 42 MB at most.
  std::size_t memoryBytes() const;

 private:
  friend class EnvironmentCube;
  EnvironmentMap() = default;
  void buildLevels(int columns);
  glm::vec3 lookupLevel(int level, float x, float y) const;
  // Means over the cells of a grid; together they have the power of the map.
  void average(const SphereGrid& grid, std::span<const float> solid_angles,
               std::span<glm::vec3> means) const;

  std::unique_ptr<SphereGrid> grid_;
  std::vector<glm::vec3> texels_;  // radiosity, of the cells of the grid
  glm::dvec3 power_{0};            // integral over the sphere
  double rotation_ = 0;
  int first_axis_ = 0;  // of the world, that A is
  // The map on a square of equal areas (SquareGrid): 2^(levels - 1) cells along an edge, then half
  // as many and so on to one
  int level_count_ = 0;
  std::vector<glm::vec3> levels_;
};

// What the pixels of a raster cube see of an environment: its mean over each of them. Immutable.
class EnvironmentCube {
 public:
  // `geometry` must be that of a whole cube.
  EnvironmentCube(const EnvironmentMap& map, const RasterGeometry& geometry);

  // Radiosity, in the order of the geometry's pixels.
  std::span<const glm::vec3> pixels() const { return pixels_; }
  std::size_t memoryBytes() const { return pixels_.size() * sizeof(glm::vec3); }

 private:
  std::vector<glm::vec3> pixels_;
};

// An environment, ready for a gather.
struct LoadedEnvironment {
  LoadedEnvironment(EnvironmentMap loaded, int raster_resolution);
  std::uint64_t memoryBytes() const { return map.memoryBytes() + cube.memoryBytes(); }

  EnvironmentMap map;
  EnvironmentCube cube;
};

// The rules of a gather under an environment, or none; it must outlive all that uses them.
GatherRules gatherRules(const GatherSettings& settings, const LoadedEnvironment* environment);

}  // namespace surfeit
