// The geometry of the generated scenes (docs/generate.md): some ten thousand surfaces, fixed by
// kind and seed, however densely they are sampled. The same on every machine: sums, products,
// quotients and square roots only, which IEEE 754 rounds in one way.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "surfels/generated/scene_recipe.h"

namespace surfeit {

// Edge of the world in metres: x and y run from 0 to this, z is up.
inline constexpr double kWorldExtent = 1000;
// Lots to a side. A lot is a square of streets with what stands on it.
inline constexpr int kLotsPerSide = 40;
inline constexpr double kLotExtent = kWorldExtent / kLotsPerSide;

// How the unit square, u and v in 0..1, becomes a surface.
enum class SurfaceShape : std::uint8_t {
  kBilinear,    // origin + u edge_u + v edge_v + u v edge_w
  kHemisphere,  // the half sphere about `origin` with half axes edge_u, edge_v and edge_w, all of
                // one length, on the side of edge_w
  kCrown,  // discs of radius `leaf_radius` in the ellipsoid about `origin` with those half axes
  kHaze,   // all of the box from `origin` along edge_u, edge_v, edge_w
};

// What decides the albedo beside `albedo`.
enum class SurfaceMaterial : std::uint8_t {
  kPlain,
  kFacade,   // windows, tiles_u by tiles_v
  kStreets,  // the ground of a lot: streets and pavement around grass
  kHills,    // grass, rock where steep, snow where high
};

// Plain data, 80 bytes.
struct Surface {
  glm::vec3 origin{0}, edge_u{0}, edge_v{0}, edge_w{0};
  glm::vec3 albedo{0};
  float area = 0;         // m^2; of leaves one side; of haze its cross-sections
  float leaf_radius = 0;  // of a crown
  std::uint16_t tiles_u = 0, tiles_v = 0;
  std::uint32_t leaves = 0;  // of a crown
  SurfaceShape shape = SurfaceShape::kBilinear;
  SurfaceMaterial material = SurfaceMaterial::kPlain;
};

// All surfaces, in the order of a scan: lots in strips that run back and forth, and in a lot the
// ground and then object by object.
std::vector<Surface> makeSceneSurfaces(SceneKind kind, std::uint64_t seed);

}  // namespace surfeit
