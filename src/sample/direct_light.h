// Direct light on a mesh: what a renderer would bake into the surfels before the gather
// (memo 08-01, section 3.1): radiosity = emission + albedo * irradiance. Exitance and irradiance
// are in W/m2, radiance in W/(m2 sr), all scene-linear rgb.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "core/split_mix.h"
#include "sample/mesh.h"
#include "sample/ray_scene.h"

namespace surfeit {

struct PointLight {
  glm::dvec3 position{0};
  glm::vec3 intensity{0};  // W/sr: E = I cos / d^2
};

struct DirectionalLight {
  glm::vec3 direction{0, -1, 0};  // in which the light travels; any length but zero
  glm::vec3 irradiance{0};        // on a surface that faces it
};

// A rectangle with corners centre +- u +- v that emits on the side of u x v. It is no geometry:
// it neither casts shadows nor is seen.
struct AreaLight {
  glm::dvec3 centre{0};
  glm::vec3 u{0}, v{0};
  glm::vec3 radiance{0};
};

struct Lights {
  std::vector<PointLight> points;
  std::vector<DirectionalLight> directionals;
  std::vector<AreaLight> areas;
  // Shadow rays per area light, and as many for all emissive triangles together.
  int samples = 16;
  // Do emissive surfaces carry their own emission as radiosity? They light the others either way; a
  // gather from surfels that carry it too would count that light twice.
  bool with_emission = false;

  // The same lights, their places counted from an origin.
  Lights countedFrom(const glm::dvec3& origin) const;
  bool isEmpty() const { return points.empty() && directionals.empty() && areas.empty(); }
};

// Lights of the options and the emissive triangles of the mesh. Immutable; safe from any thread.
class DirectLight {
 public:
  // Mesh and scene must outlive it.
  DirectLight(const Mesh& mesh, const RayScene& scene, const Lights& lights);

  // Is there anything that emits?
  bool hasLight() const { return !lights_.isEmpty() || !emissive_.empty(); }

  // Irradiance on the front side. Area lights are sampled with a Hammersley pattern shifted by
  // `seed`: the same seed gives the same value, and neighbours should get different ones.
  glm::vec3 irradiance(const SurfacePoint& point, std::uint64_t seed, int samples) const;

  // Radiant exitance of the front side: albedo * irradiance, and emission where lights say so.
  glm::vec3 exitance(const SurfacePoint& point, std::uint64_t seed, int samples) const {
    const glm::vec3 reflected = point.albedo * irradiance(point, seed, samples);
    return lights_.with_emission ? point.emission + reflected : reflected;
  }
  int samples() const { return lights_.samples; }

 private:
  bool isShadowed(const SurfacePoint& point, const glm::vec3& target) const;
  glm::vec3 fromEmitterPoint(const SurfacePoint& point, const glm::vec3& position,
                             const glm::vec3& normal, const glm::vec3& radiance) const;
  glm::vec3 fromAreaLight(const AreaLight& light, const SurfacePoint& point, std::uint64_t seed,
                          int samples) const;
  glm::vec3 fromEmissiveTriangles(const SurfacePoint& point, std::uint64_t seed, int samples) const;

  const Mesh& mesh_;
  const RayScene& scene_;
  Lights lights_;
  float offset_;                            // of shadow rays from the surface
  std::vector<std::uint32_t> emissive_;     // triangles
  std::vector<double> emissive_power_sum_;  // cumulative over emissive_, ends at the total
  glm::vec3 max_emission_{0};
};

}  // namespace surfeit
