// The raster cube of one receiver: the view of the gather from a place, pixel by pixel (memo 08-01,
// figure 3). Use it to look into a surprising result, and in tests.
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

// The kinds of contributions. Values are stable: pictures hold them.
enum class CubeKind : std::uint8_t {
  kNothing = 0,
  kFlatNode = 1,   // a flat node, drawn as one piece
  kFacet = 2,      // one facet of a node
  kRoughNode = 3,  // a node, drawn from its harmonics and moments
  kPatch = 4,      // a surfel of the mid field, drawn from its solid angle
  kTraced = 5,     // a surfel of the near field, ray traced
};
inline constexpr std::size_t kCubeKinds = 6;

struct CubePixel {
  glm::vec3 direction{0};  // unit, in world axes, through the middle of the pixel
  float solid_angle = 0;   // steradians, exact; all pixels of a cube sum to 4 pi
  // Weight of the direction, without the solid angle: by default the cosine to the normal, or 1
  // without a normal; options may weigh otherwise. 0 below the horizon and outside of a cone.
  float weight = 0;
  float coverage = 0;   // part that surfels cover, 0..1
  float occlusion = 0;  // coverage after falloff with distance
  // Light of surfels: radiosity times coverage. Zero without an output that needs light.
  glm::vec3 light{0};
  // Light of the environment map through the open part, as radiosity.
  glm::vec3 environment{0};
  // Distance at which kCubeFirstPart of the pixel is covered, in scene units. The gather knows the
  // distance of the middle of each node or surfel. Infinite where the coverage stays below that.
  float depth = std::numeric_limits<float>::infinity();
  // Things that lie behind each other and cover some of the pixel (docs/algorithm.md, "Coverage"),
  // 0 to some 100: at least 1 where anything covers.
  float layers = 0;
  float filled = 0;  // part of the coverage that comes from closing gaps
  // The kind that brought most of the coverage, closed gaps aside.
  CubeKind kind = CubeKind::kNothing;
};
inline constexpr float kCubeFirstPart = 1.f / 64;

// A face of the raster: pixel (column, row) of n by n lies around the direction of
//
//   forward + a u + b v,   a = (2 column + 1) / n - 1,   b = (2 row + 1) / n - 1.
//
// All three are in world axes, and perpendicular. forward has unit length. u and v have unit length
// for a cube; for a cone their length is the tangent of its angle.
struct CubeFace {
  glm::vec3 forward{0}, u{0}, v{0};
};

struct CubeImage {
  Receiver receiver;            // with unit vectors, or zero ones
  int resolution = 0;           // pixels along an edge of a face
  std::vector<CubeFace> faces;  // +x -x +y -y +z -z; one face for a cone of up to 60 degrees
  // Pixel (face * resolution + row) * resolution + column.
  std::vector<CubePixel> pixels;

  // The results of the gather from these pixels, for this receiver alone (GatherOutput has the
  // units). With w = weight * solid angle, occlusion is sum w occlusion / sum w; the two lights are
  // computed alike.
  float occlusion = 0;
  glm::vec3 irradiance{0}, environment{0};
  // Nodes, facets and surfels that were drawn; ray-traced surfels among them.
  std::uint64_t contributions = 0, traced_surfels = 0;
};

// Gathers at one receiver and returns its raster. Pass the options of gatherCloud; they mean the
// same. Used are mode, outputs, quality, weights, environment, groups, eye, memory and direct_io;
// max variation, order, threads and the options for files are not. Pixels have no light without an
// output that needs light (GatherSettings::outputs). The receiver is gathered alone. In gatherCloud
// it is one of a packet, and its result may differ by the amounts in docs/benchmarks.md. Works on
// one thread. Calls are independent, so threads may call at once; `memory_bytes` is the budget of
// each call. The result depends only on scene, receiver, options and instruction set, bit for bit.
// Errors: kInvalidArgument (options, a receiver that is not finite, kGlossy without a normal or a
// view), kBudgetTooSmall, kIoError, kCorruption, kInterrupted.
SURFEIT_API Result<CubeImage> gatherCube(const std::string& scene_path, const Receiver& receiver,
                                         const GatherOptions& options, Progress& progress);

// Returns row `number`, from 0, of a cloud of receivers, read as gatherCloud reads it. `channels`,
// `part` and `filter` are as in ReadOptions; rows that the filter leaves out do not count. Reads up
// to that row. Errors: kInvalidArgument when there is no such row, kCorruption when it is no valid
// receiver, else as indexClouds.
SURFEIT_API Result<Receiver> readCubeReceiver(const std::string& cloud_path, std::uint64_t number,
                                              const std::string& channels, const std::string& part,
                                              Progress& progress, const std::string& filter = {});

}  // namespace surfeit
