// Foliage: what is thin, seen from both sides, and nowhere a surface.
#include <cmath>
#include <glm/geometric.hpp>

#include "bench/internal/gather_scene_geometry.h"

namespace surfeit {
namespace {

constexpr double kGroundEdge = 10;
constexpr int kCrowns = 40;
constexpr double kLeavesOfUnitCrown = 2500;  // in a crown of radius 1 of middling density

// A parallelogram around `middle` with half sides u and v.
void appendLeaf(const glm::dvec3& middle, const glm::dvec3& u, const glm::dvec3& v, Mesh& mesh) {
  const auto corner = [&](double s, double t) {
    return glm::vec3(middle + (2 * s - 1) * u + (2 * t - 1) * v);
  };
  appendGrid(1, 1, corner, 0, mesh);
}

// Even in the ball of radius 1.
glm::dvec3 placeInBall(SceneRandom& random) {
  glm::dvec3 place;
  do {
    for (int axis = 0; axis < 3; ++axis) place[axis] = random.next(-1, 1);
  } while (glm::dot(place, place) >= 1);
  return place;
}

glm::dvec3 unitVector(SceneRandom& random) {
  glm::dvec3 place;
  do {
    place = placeInBall(random);
  } while (glm::dot(place, place) < 0.01);
  return glm::normalize(place);
}

void appendCrown(SceneRandom& random, Mesh& mesh) {
  const double radius = random.next(0.5, 1);
  const double x = random.next(-4, 4), y = random.next(-4, 4), z = random.next(1.2, 2.5);
  const int leaves = int(kLeavesOfUnitCrown * radius * radius * random.next(0.4, 1.6));
  for (int i = 0; i < leaves; ++i) {
    const glm::dvec3 middle = glm::dvec3(x, y, z) + radius * placeInBall(random);
    const glm::dvec3 along = unitVector(random), other = unitVector(random);
    const glm::dvec3 across = glm::cross(along, other);
    if (glm::dot(across, across) < 1e-6) continue;
    appendLeaf(middle, random.next(0.02, 0.045) * along,
               random.next(0.012, 0.025) * glm::normalize(across), mesh);
  }
}

}  // namespace

SceneGeometry makeLeaves() {
  SceneGeometry geometry;
  SceneRandom random(5);
  appendLeaf(glm::dvec3(0), glm::dvec3(kGroundEdge / 2, 0, 0), glm::dvec3(0, kGroundEdge / 2, 0),
             geometry.mesh);
  for (int i = 0; i < kCrowns; ++i) appendCrown(random, geometry.mesh);
  geometry.exact_triangles = geometry.mesh.triangle.size();
  geometry.is_two_sided = true;
  geometry.ray_offset = 1e-4f;
  geometry.color_wavelength = 1;
  geometry.surfels = 2'000'000;
  return geometry;
}

}  // namespace surfeit
