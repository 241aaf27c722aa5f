// The scene on which open point-based renderers were measured (docs/benchmarks.md).
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <vector>

#include "bench/internal/gather_scene_geometry.h"

namespace surfeit {
namespace {

constexpr double kPiDouble = 3.141592653589793;
constexpr double kGroundEdge = 10;
constexpr int kTiles = 20;  // to a side of the ground
constexpr int kSpheres = 500, kRestingSpheres = 150;
constexpr double kSmallest = 0.05, kLargest = 0.5, kHeight = 4;
// Disk radius over that of a disk of the surfel's area: overlaps enough to leave no gaps.
constexpr double kOverlap = 1.4;

double sphereArea(const TrueSphere& sphere) {
  return 4 * kPiDouble * double(sphere.radius) * double(sphere.radius);
}

bool overlapsAny(const TrueSphere& sphere, const std::vector<TrueSphere>& others) {
  return std::any_of(others.begin(), others.end(), [&](const TrueSphere& other) {
    return glm::distance(sphere.centre, other.centre) < sphere.radius + other.radius;
  });
}

// Places the largest first, while there is room.
void placeSpheres(int count, bool are_resting, SceneRandom& random,
                  std::vector<TrueSphere>& spheres) {
  std::vector<float> radii;
  for (int i = 0; i < count; ++i) radii.push_back(float(random.next(kSmallest, kLargest)));
  std::sort(radii.begin(), radii.end(), std::greater<>());
  for (const float radius : radii) {
    TrueSphere sphere;
    sphere.radius = radius;
    do {
      const double reach = 0.5 * kGroundEdge - double(radius);
      const double x = random.next(-reach, reach), y = random.next(-reach, reach);
      const double z =
          are_resting ? double(radius) : random.next(double(radius), kHeight - double(radius));
      sphere.centre = glm::vec3(x, y, z);
    } while (overlapsAny(sphere, spheres));
    spheres.push_back(sphere);
  }
}

std::uint32_t tileAt(const glm::vec3& position) {
  const auto tile = [](float x) {
    const double along = (double(x) / kGroundEdge + 0.5) * kTiles;
    return std::clamp(int(std::floor(along)), 0, kTiles - 1);
  };
  return std::uint32_t(tile(position.y) * kTiles + tile(position.x));
}

// Rows of a hexagonal lattice that fills the ground exactly, every second one shifted by half.
Status sendGround(const SceneGeometry& geometry, double surfel_area, const SurfelSink& sink) {
  SceneRandom random(7);
  const double spacing = std::sqrt(surfel_area * 2 / std::sqrt(3.0));
  const int columns = int(std::round(kGroundEdge / spacing));
  const int rows = int(std::round(kGroundEdge * kGroundEdge / surfel_area / columns));
  const double column_width = kGroundEdge / columns, row_height = kGroundEdge / rows;
  constexpr double kJitter = 0.15;  // of a column
  std::vector<Surfel> run(std::size_t(columns), Surfel{});
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double shift = row % 2 == 0 ? 0.25 : 0.75;
      const double jitter_x = kJitter * random.next(-1, 1), jitter_y = kJitter * random.next(-1, 1);
      Surfel& surfel = run[std::size_t(column)];
      surfel.position = glm::vec3((column + shift + jitter_x) * column_width - 0.5 * kGroundEdge,
                                  (row + 0.5 + jitter_y) * row_height - 0.5 * kGroundEdge, 0);
      surfel.normal = {0, 0, 1};
      surfel.area = float(column_width * row_height);
      surfel.radius = float(kOverlap * std::sqrt(column_width * row_height / kPiDouble));
      surfel.radiosity = radiosityAt(geometry, tileAt(surfel.position), surfel.position);
    }
    SURFEIT_RETURN_IF_ERROR(sink(run));
  }
  return {};
}

Status sendSphere(const SceneGeometry& geometry, const TrueSphere& sphere, double surfel_area,
                  const SurfelSink& sink) {
  const double golden_angle = kPiDouble * (3 - std::sqrt(5.0));
  const int count = std::max(8, int(std::round(sphereArea(sphere) / surfel_area)));
  const double area = sphereArea(sphere) / count;
  std::vector<Surfel> run(std::size_t(count), Surfel{});
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count, across = std::sqrt(1 - z * z);
    const glm::dvec3 outwards(across * std::cos(golden_angle * i),
                              across * std::sin(golden_angle * i), z);
    Surfel& surfel = run[std::size_t(i)];
    surfel.position = glm::vec3(glm::dvec3(sphere.centre) + double(sphere.radius) * outwards);
    surfel.normal = glm::vec3(outwards);
    surfel.area = float(area);
    surfel.radius = float(kOverlap * std::sqrt(area / kPiDouble));
    surfel.radiosity = radiosityAt(geometry, sphere.material, surfel.position);
  }
  return sink(run);
}

}  // namespace

SceneGeometry makeSpheres() {
  SceneRandom random(7);
  SceneGeometry geometry;
  geometry.surfels = 1'000'000;
  geometry.ray_offset = 1e-4f;
  placeSpheres(kRestingSpheres, true, random, geometry.spheres);
  placeSpheres(kSpheres - kRestingSpheres, false, random, geometry.spheres);

  // A material for each tile, then for each sphere
  for (int tile = 0; tile < kTiles * kTiles; ++tile) {
    geometry.mesh.materials.push_back({glm::vec3(0.5f), random.nextColor(), kNoTexture});
    const double x = tile % kTiles, y = std::floor(double(tile) / kTiles);
    const auto corner = [&](double u, double v) {
      return glm::vec3(((x + u) / kTiles - 0.5) * kGroundEdge,
                       ((y + v) / kTiles - 0.5) * kGroundEdge, 0);
    };
    appendGrid(1, 1, corner, std::uint32_t(tile), geometry.mesh);
  }
  geometry.exact_triangles = geometry.mesh.triangle.size();
  for (TrueSphere& sphere : geometry.spheres) {
    sphere.material = std::uint32_t(geometry.mesh.materials.size());
    geometry.mesh.materials.push_back({glm::vec3(0.5f), random.nextColor(), kNoTexture});
    // Less than 0.0004 between the triangles and the sphere, as from a careful modeller
    appendSphere(sphere, std::max(24, int(170 * sphere.radius)), geometry.mesh);
  }
  return geometry;
}

Status sendSpheresSurfels(const SceneGeometry& geometry, std::uint64_t count,
                          const SurfelSink& sink) {
  double area = kGroundEdge * kGroundEdge;
  for (const TrueSphere& sphere : geometry.spheres) area += sphereArea(sphere);
  const double surfel_area = area / double(count);
  SURFEIT_RETURN_IF_ERROR(sendGround(geometry, surfel_area, sink));
  for (const TrueSphere& sphere : geometry.spheres) {
    SURFEIT_RETURN_IF_ERROR(sendSphere(geometry, sphere, surfel_area, sink));
  }
  return {};
}

}  // namespace surfeit
