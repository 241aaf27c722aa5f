#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "bench/internal/gather_scene_geometry.h"
#include "core/square_strata.h"
#include "surfels/generated/scene_surfaces.h"
#include "surfels/generated/surface_surfel.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kSeed = 1;
// How far the triangles may be from the surface, metres.
constexpr double kLargestDeviation = 0.005;
constexpr std::size_t kTrunkSurfaces = 4;  // before each crown

// All surfaces but those of trees.
std::vector<Surface> treelessSurfaces() {
  std::vector<Surface> kept;
  for (const Surface& surface : makeSceneSurfaces(SceneKind::kCity, kSeed)) {
    if (surface.shape == SurfaceShape::kCrown) {
      kept.resize(kept.size() - kTrunkSurfaces);
    } else {
      kept.push_back(surface);
    }
  }
  return kept;
}

// A cell of an n by n grid departs from its bilinear surface by a quarter of the twist over n^2.
void appendBilinear(const Surface& surface, std::uint32_t material, Mesh& mesh) {
  const double twist = double(glm::length(surface.edge_w));
  const int cells = std::max(1, int(std::ceil(std::sqrt(0.25 * twist / kLargestDeviation))));
  const auto corner = [&](double u, double v) {
    return glm::vec3(glm::dvec3(surface.origin) + u * glm::dvec3(surface.edge_u) +
                     v * glm::dvec3(surface.edge_v) + u * v * glm::dvec3(surface.edge_w));
  };
  appendGrid(cells, cells, corner, material, mesh);
}

}  // namespace

SceneGeometry makeCity() {
  SceneGeometry geometry;
  geometry.surfels = 10'000'000;
  geometry.ray_offset = 0.01f;
  geometry.color_wavelength = float(kLotExtent);
  geometry.mesh.materials.push_back({});
  for (const Surface& surface : treelessSurfaces()) {
    if (surface.shape == SurfaceShape::kBilinear) {
      appendBilinear(surface, 0, geometry.mesh);
    } else if (surface.edge_w.z > 0) {  // the other half of the sphere is a surface of its own
      geometry.spheres.push_back({surface.origin, surface.edge_u.x, 0});
    }
  }
  geometry.exact_triangles = geometry.mesh.triangle.size();
  for (const TrueSphere& sphere : geometry.spheres) {
    const double step = std::sqrt(8 * kLargestDeviation / double(sphere.radius));
    appendSphere(sphere, int(std::ceil(6.2831853 / step)), geometry.mesh);
  }
  return geometry;
}

// Deals surfels to surfaces by area, as surfels/generated/scene_generator.cpp does.
Status sendCitySurfels(const SceneGeometry& geometry, std::uint64_t count, const SurfelSink& sink) {
  const std::vector<Surface> surfaces = treelessSurfaces();
  double area = 0;
  for (const Surface& surface : surfaces) area += double(surface.area);

  std::vector<Surfel> run;
  double area_before = 0;
  std::uint64_t first = 0;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    area_before += double(surfaces[i].area);
    const auto end = std::uint64_t(std::floor(area_before / area * double(count) + 0.5));
    if (end == first) continue;
    SurfaceShare share{hashOf(kSeed, i), end - first, 0, area / double(count)};
    share.rows = cellRows(surfaces[i], share.count);
    run.clear();
    for (std::uint64_t index = 0; index < share.count; ++index) {
      Surfel surfel = makeSurfaceSurfel(surfaces[i], share, index);
      surfel.radiosity = radiosityAt(geometry, 0, surfel.position);
      run.push_back(surfel);
    }
    SURFEIT_RETURN_IF_ERROR(sink(run));
    first = end;
  }
  return {};
}

}  // namespace surfeit
