// Step one of the memo: surfels with direct light from triangle meshes (section 3.1).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sample/direct_light.h"
#include "sample/mesh.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// What stands around the meshes; the sampler and the reference share it.
struct Surroundings {
  glm::vec3 default_albedo{0.5f};  // of meshes without colors and materials
  GroundPlane ground;
  Lights lights;
};

// kInvalidArgument, saying which value, when lights or ground cannot work.
Status checkSurroundings(const Surroundings& surroundings);

// The meshes (loadMeshes) on their ground, as the surroundings have it.
Result<Mesh> loadScene(const std::vector<std::string>& meshes, const Surroundings& surroundings,
                       Progress& progress);

struct SampleOptions {
  Surroundings surroundings;
  std::uint64_t count = 1'000'000;  // surfels, in proportion to area; slivers add a few
  double spacing = 0;               // > 0: one surfel per spacing^2 instead of a count
  bool is_two_sided = false;        // both sides send and block light, and pieces have longer sides
  int threads = 0;                  // 0: all that the job may use
};

struct SampleStats {
  std::uint64_t triangles = 0;
  std::uint64_t degenerate_faces = 0;
  std::uint64_t surfels = 0;         // written
  std::uint64_t sliver_surfels = 0;  // beyond the count asked for, from cutting slivers
  std::uint64_t clear_surfels = 0;   // not written: nothing of them is there (d, Tr, map_d)
  double area = 0;                   // of the meshes
  double disk_area = 0;              // sum of pi r^2: over `area`, how often disks overlap
  double spacing = 0;                // root of the area per surfel
  double load_seconds = 0, build_seconds = 0, sample_seconds = 0;
  int threads = 0;
};

// Writes a cloud of the format that its name tells, with normals, radii, areas, albedo, when
// anything emits, radiosity, and of two-sided meshes two_sided and longer sides. The cloud depends
// on meshes and options alone, not on the threads. Memory: the meshes, Embree's hierarchy (less
// than 100 bytes per triangle) and a few batches of surfels, whatever the count. Errors: kIoError,
// kCorruption (bad mesh), kInvalidArgument (options), kInterrupted, kFailed.
Result<SampleStats> sampleMeshes(const std::vector<std::string>& meshes, const std::string& output,
                                 const SampleOptions& options, Progress& progress);

}  // namespace surfeit
