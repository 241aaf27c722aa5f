// Photon maps: photons sent from the lights and scattered through the meshes, stored wherever they
// meet a diffuse surface (Jensen 1996; app note 6.1). `surfeit radiance` makes surfels of them.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "sample/sample.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct PhotonTracingOptions {
  Surroundings surroundings;
  std::uint64_t photons = 1'000'000;  // sent from all lights together, at least 1
  std::uint64_t seed = 0;             // another seed, other photons of the same light
  int threads = 0;                    // 0: all that the job may use
};

struct PhotonTracingStats {
  std::uint64_t triangles = 0;
  std::uint64_t degenerate_faces = 0;
  std::uint64_t emitted = 0;
  std::uint64_t stored = 0;         // at most one per surface that a photon meets
  std::uint64_t escaped = 0;        // photons that left the scene in the end
  std::uint64_t lost_at_backs = 0;  // photons that met the back of a surface, which is black
  glm::dvec3 emitted_power{0};      // of all lights
  glm::dvec3 stored_power{0};       // arrives at surfaces, those of later bounces included
  double load_seconds = 0, build_seconds = 0, trace_seconds = 0;
  int threads = 0;
};

// Writes a photon cloud of the format that the name of the output tells: position, normal of the
// surface, power before reflection, direction that the photon came from, albedo; floats, by the
// names of docs/photons.md. Lights get photons in proportion to power; directional ones fill a disk
// that covers the scene. Russian roulette ends the paths, so that powers stay as large as albedos
// are alike, and no bounce is left out. The cloud depends on meshes, surroundings, number and seed
// alone, not on the threads. Memory: the meshes, Embree's hierarchy and a few batches of photons,
// whatever their number. Errors: as sampleMeshes; kInvalidArgument when nothing emits.
Result<PhotonTracingStats> tracePhotons(const std::vector<std::string>& meshes,
                                        const std::string& output,
                                        const PhotonTracingOptions& options, Progress& progress);

}  // namespace surfeit
