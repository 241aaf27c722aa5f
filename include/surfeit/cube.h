// The raster cube of one receiver: what the gather sees from a place, pixel by pixel (memo 08-01,
// figure 3). For looking at a receiver whose result surprises, and for tests.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// What something was drawn as. Values are stable: pictures hold them.
enum class CubeKind : std::uint8_t {
  kNothing = 0,
  kFlatNode = 1,   // a node as one piece
  kFacet = 2,      // a facet of a node of several
  kRoughNode = 3,  // a node by its harmonics and moments
  kPatch = 4,      // a surfel of the mid field, by its solid angle
  kTraced = 5,     // a surfel of the near field, by rays
};
inline constexpr std::size_t kCubeKinds = 6;

struct CubePixel {
  glm::vec3 direction{0};  // unit, of the world, through the middle of the pixel
  float solid_angle = 0;   // steradians, exact; those of a whole cube sum to 4 pi
  // What the direction counts, without the solid angle: the cosine to the normal unless options
  // weigh otherwise, 1 without a normal. 0 below the horizon and outside of a cone.
  float weight = 0;
  float coverage = 0;   // part that surfels cover, 0..1
  float occlusion = 0;  // the same, each part times what falloff leaves of it
  // Light of surfels: radiosity times coverage. Zero without an output that needs light.
  glm::vec3 light{0};
  // Light of the environment map through what is open, as radiosity.
  glm::vec3 environment{0};
  // Distance of the nearest things, in scene units: from where kCubeFirstPart of the pixel is
  // covered. The gather knows it for the middle of each node or surfel. Infinite where so much is
  // never covered.
  float depth = std::numeric_limits<float>::infinity();
  // Layers that began in the pixel (docs/algorithm.md, "Coverage"), fractions of them included; at
  // least 1 where anything covers, else 0.
  float layers = 0;
  float filled = 0;  // part of the coverage that comes from closing gaps
  // What most of the coverage, gaps aside, comes from.
  CubeKind kind = CubeKind::kNothing;
};
inline constexpr float kCubeFirstPart = 1.f / 64;

// A face of the raster: pixel (column, row) of n by n lies around the direction of
//
//   forward + a u + b v,   a = (2 column + 1) / n - 1,   b = (2 row + 1) / n - 1.
//
// All three are of the world and perpendicular. forward has unit length; u and v of a cube have,
// too, and of a cone they are as long as the tangent of its angle.
struct CubeFace {
  glm::vec3 forward{0}, u{0}, v{0};
};

struct CubeImage {
  Receiver receiver;            // with unit vectors, or zero ones
  int resolution = 0;           // pixels along an edge of a face
  std::vector<CubeFace> faces;  // +x -x +y -y +z -z; or one, of a cone of up to 60 degrees
  // Pixel (face * resolution + row) * resolution + column.
  std::vector<CubePixel> pixels;

  // What the gather makes of the pixels for this receiver alone (GatherOutput has the units). With
  // w = weight * solid angle: occlusion is sum w occlusion / sum w, and so are the two lights.
  float occlusion = 0;
  glm::vec3 irradiance{0}, environment{0};
  // Nodes, facets and surfels that were drawn, and of these the ray-traced surfels.
  std::uint64_t contributions = 0, traced_surfels = 0;
};

// Gathers at one receiver and returns its raster. Options mean what they mean to gatherCloud, so
// give it the same: mode, outputs, quality, weights, environment, groups, eye, memory and direct_io
// count; max variation, order, threads and all about files do not. Without
// an output that needs light (GatherOptions::outputs), pixels have none. The receiver is gathered
// alone, by the scalar definition of the gather; in gatherCloud it shares its cut with neighbours
// and may differ by what docs/benchmarks.md tells. Works on one thread. Calls are independent, so
// threads may call at once; `memory_bytes` is the budget of each. The result depends on scene,
// receiver and options alone, bit for bit.
// Errors: kInvalidArgument (options, a receiver that is not finite, kGlossy without a normal or a
// view), kBudgetTooSmall, kIoError, kCorruption, kInterrupted.
SURFEIT_API Result<CubeImage> gatherCube(const std::string& scene_path, const Receiver& receiver,
                                         const GatherOptions& options, Progress& progress);

// Row `number`, from 0, of a cloud of receivers as gatherCloud reads them; `channels`, `part` and
// `filter` as in GatherOptions: rows that are left out do not count. Reads up to that row. Errors:
// kInvalidArgument when there is no such row, kCorruption when it is no valid receiver, else as
// indexClouds.
SURFEIT_API Result<Receiver> readCubeReceiver(const std::string& cloud_path, std::uint64_t number,
                                              const std::string& channels, const std::string& part,
                                              Progress& progress, const std::string& filter = {});

}  // namespace surfeit
