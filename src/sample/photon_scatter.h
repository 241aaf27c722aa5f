// What happens to a photon that meets a surface (app note 6.1; docs/photons.md, "Materials").
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "sample/meshes/mesh.h"
#include "sample/photon_random.h"

namespace surfeit {

// A photon on its way.
struct PhotonRay {
  glm::vec3 origin{0}, direction{0};  // unit length
  glm::vec3 power{0};
};

enum class ScatterKind : std::uint8_t { kDiffuse, kSpecular };

// A surface that scatters photons, where it is met.
struct ScatterPoint {
  SurfacePoint point;
  const Material* material = nullptr;
  bool is_back = false;  // met from behind
};

// Whether the photon is stored there: the surface is diffuse, if only black.
bool storesPhotons(const ScatterPoint& at);
// Whether the side that is met takes part; else it is black.
bool scattersSide(const ScatterPoint& at);

// Sends the photon on, from `offset` off the surface, with the power that makes up for those that
// are absorbed there; nothing when it is absorbed itself (Russian roulette). The mean of powers is
// that of the material.
std::optional<ScatterKind> scatter(const ScatterPoint& at, float offset, PhotonRandom& random,
                                   PhotonRay& ray);

// Part of the light that glass of that index reflects (Fresnel, both polarizations alike) where it
// arrives under that cosine; `eta` is the index before the surface over that behind.
float fresnelReflectance(float cos_theta, float eta);

}  // namespace surfeit
