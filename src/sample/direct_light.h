// Direct light on a mesh: what a renderer would bake into the surfels before the gather
// (memo 08-01, section 3.1): radiosity = emission + albedo * irradiance. Exitance and irradiance
// are in W/m2, radiance in W/(m2 sr), all scene-linear rgb.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "core/split_mix.h"
#include "sample/meshes/mesh.h"
#include "sample/ray_scene.h"
#include "surfeit/sample.h"

namespace surfeit {

// The same lights, their places counted from an origin.
Lights countedFrom(Lights lights, const glm::dvec3& origin);

// Lights of the options and the emissive triangles of the mesh. Immutable; safe from any thread.
class DirectLight {
 public:
  // Mesh and scene must outlive it.
  DirectLight(const Mesh& mesh, const RayScene& scene, const Lights& lights)
      : DirectLight(mesh, &scene, lights) {}
  // The same without shadows.
  DirectLight(const Mesh& mesh, const Lights& lights) : DirectLight(mesh, nullptr, lights) {}

  // Is there anything that emits?
  bool hasLight() const { return !lights_.isEmpty() || hasEmissiveMeshes(); }
  bool hasEmissiveMeshes() const { return !emissive_.empty(); }

  // Irradiance on the front side; at a point without a normal the mean over the surface of a small
  // sphere. Area lights are sampled with a Hammersley pattern shifted by
  // `seed`: the same seed gives the same value, and neighbours should get different ones.
  glm::vec3 irradiance(const SurfacePoint& point, std::uint64_t seed, int samples) const;

  // Radiant exitance of the front side: albedo * irradiance, and emission where lights say so.
  glm::vec3 exitance(const SurfacePoint& point, std::uint64_t seed, int samples) const {
    const glm::vec3 reflected = point.albedo * irradiance(point, seed, samples);
    return lights_.with_emission ? point.emission + reflected : reflected;
  }
  int samples() const { return lights_.samples; }

 private:
  DirectLight(const Mesh& mesh, const RayScene* scene, const Lights& lights);

  float falloffAt(float distance_sq) const;
  glm::vec3 rayOrigin(const SurfacePoint& point) const;
  glm::vec3 passedLight(const SurfacePoint& point, const glm::vec3& target) const;
  glm::vec3 fromEmitterPoint(const SurfacePoint& point, const glm::vec3& position,
                             const glm::vec3& normal, const glm::vec3& radiance,
                             float falloff) const;
  glm::vec3 fromAreaLight(const AreaLight& light, const SurfacePoint& point, std::uint64_t seed,
                          int samples) const;
  glm::vec3 fromEmissiveTriangles(const SurfacePoint& point, std::uint64_t seed, int samples) const;

  const Mesh& mesh_;
  const RayScene* scene_;  // null: nothing casts shadows
  Lights lights_;
  float offset_;                            // of shadow rays from the surface
  std::vector<std::uint32_t> emissive_;     // triangles
  std::vector<double> emissive_power_sum_;  // cumulative over emissive_, ends at the total
  glm::vec3 max_emission_{0};
};

}  // namespace surfeit
