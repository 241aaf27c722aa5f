#include "sample/traced_cube.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "core/guard.h"
#include "core/job_limits.h"

namespace surfeit {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kOffset = 1e-4f;  // of rays above the receiver, over the diagonal

bool covers(float cosine, GatherSides sides) {
  if (sides == GatherSides::kBoth) return true;
  return sides == GatherSides::kFront ? cosine < 0 : cosine > 0;
}

// Distance of the first surface that covers, or infinity.
float trace(const Mesh& mesh, const RayScene& rays, const glm::vec3& origin,
            const glm::vec3& direction, const TracedCubeOptions& options) {
  // As in ReferenceScene::gather: only rays caught in coplanar triangles meet more
  constexpr int kMaxLayers = 64;
  float begin = 0;
  for (int layer = 0; layer < kMaxLayers; ++layer) {
    const std::optional<RayHit> hit =
        rays.closestHit(origin, direction, begin, options.max_distance);
    if (!hit) break;
    const SurfacePoint point = surfacePoint(mesh, hit->triangle, hit->u, hit->v);
    if (covers(glm::dot(point.geometric_normal, direction), options.sides)) return hit->distance;
    begin = std::nextafter(hit->distance + 0.1f * rays.surfaceOffset(), kInfinity);
  }
  return kInfinity;
}

}  // namespace

CubeImage traceCube(const CubeImage& cube, const Mesh& mesh, const RayScene& rays,
                    const TracedCubeOptions& options) {
  const glm::vec3 normal = cube.receiver.normal;
  const bool has_horizon = normal != glm::vec3(0);
  const glm::vec3 origin = glm::vec3(cube.receiver.position - mesh.origin) +
                           kOffset * glm::length(rays.bounds().extent()) * normal;
  const int size = cube.resolution, places = size * options.rays;
  CubeImage traced;
  traced.receiver = cube.receiver;
  traced.resolution = size;
  traced.faces = cube.faces;
  double sum = 0, weight_sum = 0;
  for (std::size_t i = 0; i < cube.pixels.size(); ++i) {
    const CubePixel& like = cube.pixels[i];
    CubePixel pixel;
    pixel.direction = like.direction;
    pixel.solid_angle = like.solid_angle;
    pixel.weight = like.weight;
    const int row = int(i) / size % size, column = int(i) % size;
    const CubeFace& face = cube.faces[i / std::size_t(size * size)];
    double hit = 0, all = 0;
    for (int ray = 0; ray < options.rays * options.rays; ++ray) {
      const int x = column * options.rays + ray % options.rays;
      const int y = row * options.rays + ray / options.rays;
      const float a = float(2 * x + 1) / float(places) - 1;
      const float b = float(2 * y + 1) / float(places) - 1;
      const glm::vec3 toward = face.forward + a * face.u + b * face.v;
      if (has_horizon && !(glm::dot(toward, normal) > 0)) continue;

      // Equal areas of the face are smaller solid angles farther out
      const float length = glm::length(toward);
      const double part = 1 / (double(length) * double(length) * double(length));
      const float distance = trace(mesh, rays, origin, toward / length, options);
      all += part;
      if (distance == kInfinity) continue;
      hit += part;
      pixel.depth = std::min(pixel.depth, distance);
    }
    if (all > 0) pixel.coverage = float(hit / all);
    pixel.occlusion = pixel.coverage;
    pixel.layers = pixel.coverage > 0 ? 1.f : 0.f;
    const double weight = double(pixel.weight) * double(pixel.solid_angle);
    sum += weight * double(pixel.coverage);
    weight_sum += weight;
    traced.pixels.push_back(pixel);
  }
  traced.occlusion = weight_sum > 0 ? float(sum / weight_sum) : 0;
  return traced;
}

Result<CubeImage> traceCube(const CubeImage& cube, const std::vector<std::string>& meshes,
                            const TracedCubeOptions& options, Progress& progress) {
  if (options.rays < 1) {
    return Status::invalidArgument("rays along an edge of a pixel: expected at least 1");
  }
  if (meshes.empty()) return Status::invalidArgument("traced cube: no mesh");
  return guarded(meshes.front(), [&]() -> Result<CubeImage> {
    SURFEIT_ASSIGN_OR_RETURN(const Mesh mesh, loadMeshes(meshes, Material().albedo, progress));
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    SURFEIT_ASSIGN_OR_RETURN(const RayScene rays, RayScene::build(mesh, threads));
    return traceCube(cube, mesh, rays, options);
  });
}

}  // namespace surfeit
