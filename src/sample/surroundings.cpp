#include "sample/surroundings.h"

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {

Status checkSurroundings(const Surroundings& surroundings) {
  if (surroundings.lights.samples < 1 || surroundings.lights.samples > 65536) {
    return Status::invalidArgument(
        fmt::format("light samples {}: expected 1 to 65536", surroundings.lights.samples));
  }
  const Lights& lights = surroundings.lights;
  if (!(lights.falloff >= 0) || !(lights.falloff <= 8)) {
    return Status::invalidArgument(
        fmt::format("falloff of lights {}: expected 0 (none) to 8; 2 is physical", lights.falloff));
  }
  if (!(lights.falloff_distance > 0) || !std::isfinite(lights.falloff_distance)) {
    return Status::invalidArgument(fmt::format(
        "falloff distance of lights {}: expected a positive length", lights.falloff_distance));
  }
  if (!(surroundings.curves.width >= 0) || !std::isfinite(surroundings.curves.width)) {
    return Status::invalidArgument(
        fmt::format("curves of width {}: expected a positive length", surroundings.curves.width));
  }
  const GroundPlane& ground = surroundings.ground;
  if (!(ground.size > 0) || !(ground.size < 1e6f)) {
    return Status::invalidArgument(
        fmt::format("ground of size {}: expected a size up to 1e6", ground.size));
  }
  // A sum is finite only when all its terms are
  const auto isFinite = [](const glm::vec3& sum) { return std::isfinite(sum.x + sum.y + sum.z); };
  for (const PointLight& light : surroundings.lights.points) {
    if (!isFinite(glm::vec3(light.position) + light.intensity)) {
      return Status::invalidArgument("point light: a value is not finite");
    }
  }
  for (const DirectionalLight& light : surroundings.lights.directionals) {
    const float length = glm::length(light.direction);
    if (!(length > 0) || !isFinite(light.direction / length + light.irradiance)) {
      return Status::invalidArgument("directional light: direction is zero or a value not finite");
    }
  }
  for (const AreaLight& light : surroundings.lights.areas) {
    const float quarter_area = glm::length(glm::cross(light.u, light.v));
    if (!(quarter_area > 0) || !std::isfinite(quarter_area) ||
        !isFinite(glm::vec3(light.centre) + light.radiance)) {
      return Status::invalidArgument(
          "area light: half edges u and v are parallel or zero, or a value is not finite");
    }
  }
  return {};
}

Result<Mesh> loadScene(const std::vector<std::string>& meshes, const Surroundings& surroundings,
                       Progress& progress, SampleGroups groups) {
  SURFEIT_ASSIGN_OR_RETURN(Mesh mesh, loadMeshes(meshes, surroundings.default_albedo, progress,
                                                 surroundings.curves, groups));
  addGroundPlane(surroundings.ground, mesh);
  return mesh;
}

}  // namespace surfeit
