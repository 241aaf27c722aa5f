// The truth that gathers are measured against: rays traced from receivers to the true triangles,
// lit as the surfels were.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "surfeit/sample.h"

namespace surfeit {

// Estimates at one receiver. "Front" lets rays pass through the back of a surface, as a gather
// does whose surfels cover from the front only; "both" stops them there, where no light comes from.
struct ReferenceGather {
  float occlusion_front = 0, occlusion_both = 0;  // cosine-weighted share of rays that hit
  glm::vec3 irradiance_front{0}, irradiance_both{0};
};

struct ReferenceQuality {
  int rays = 1024;
  // Shadow rays per light and hit; the noise goes down with all rays together, so few will do.
  int light_samples = 2;
  float offset = 0;  // above the receiver, along its normal; 0: 1/10000 of the scene's diagonal
  float max_distance = 1e30f;
};

// Meshes, their hierarchy and lights. Immutable; safe from any thread.
class ReferenceScene {
 public:
  // The same meshes and surroundings as sampleMeshes. Errors: as there.
  static Result<ReferenceScene> load(const std::vector<std::string>& meshes,
                                     const Surroundings& surroundings, int threads,
                                     Progress& progress);
  ReferenceScene(ReferenceScene&&) noexcept;
  ReferenceScene& operator=(ReferenceScene&&) noexcept;
  ~ReferenceScene();

  const Mesh& mesh() const;
  const RayScene& rays() const;
  const DirectLight& light() const;

  // Occlusion and irradiance at a receiver, in world units, with unit normal. The rays are
  // cosine-weighted and stratified, shifted by `seed`; the same seed gives the same estimate.
  ReferenceGather gather(const glm::dvec3& position, const glm::vec3& normal, std::uint64_t seed,
                         const ReferenceQuality& quality) const;

  // Occlusion alone (both sides), by any-hit rays: what ambient occlusion costs a ray tracer.
  float occlusion(const glm::dvec3& position, const glm::vec3& normal, std::uint64_t seed,
                  const ReferenceQuality& quality) const;

 private:
  struct State;
  ReferenceGather gatherColor(const glm::dvec3& position, const glm::vec3& normal,
                              std::uint64_t seed, const ReferenceQuality& quality,
                              std::uint32_t color) const;
  explicit ReferenceScene(std::unique_ptr<State> state);
  glm::vec3 rayOrigin(const glm::dvec3& position, const glm::vec3& normal, float offset) const;
  std::unique_ptr<State> state_;
};

}  // namespace surfeit
