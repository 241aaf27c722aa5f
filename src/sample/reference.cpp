#include "sample/reference.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"
#include "sample/surroundings.h"

namespace surfeit {
namespace {

// `count` directions over the hemisphere around a normal, with density cos / pi: a jittered grid
// on the unit square, lifted from the disk r = sqrt(u), phi = 2 pi v. When count is no square, rows
// differ by one sample, and in height as much, so that all samples weigh the same.
class CosineDirections {
 public:
  CosineDirections(const glm::vec3& normal, int count, std::uint64_t seed)
      : normal_(normal), frame_(normal), seed_(seed), count_(count) {
    rows_ = std::max(1, int(std::sqrt(double(count))));
  }

  glm::vec3 operator[](int i) const {
    // Row r holds the samples i with floor(i rows / n) = r
    const std::int64_t n = count_, rows = rows_;
    const std::int64_t row = i * rows / n;
    const std::int64_t begin = (row * n + rows - 1) / rows, end = ((row + 1) * n + rows - 1) / rows;
    const std::uint64_t bits = splitMix(seed_ + std::uint64_t(i));
    const float jitter_u = float(bits >> 40) * 0x1p-24f;
    const float jitter_v = float((bits >> 8) & 0xffffff) * 0x1p-24f;
    const float u = (float(begin) + jitter_u * float(end - begin)) / float(n);
    const float v = (float(i - begin) + jitter_v) / float(end - begin);

    const float r = std::sqrt(u), phi = 2 * kPi * v;
    const float cos_theta = std::sqrt(std::max(0.0f, 1 - u));
    return glm::normalize(frame_.tangent * (r * std::cos(phi)) +
                          frame_.bitangent * (r * std::sin(phi)) + normal_ * cos_theta);
  }

 private:
  glm::vec3 normal_;
  TangentFrame frame_;
  std::uint64_t seed_;
  int count_, rows_;
};

}  // namespace

struct ReferenceScene::State {
  Mesh mesh;
  std::optional<RayScene> rays;
  std::optional<DirectLight> light;
};

ReferenceScene::ReferenceScene(std::unique_ptr<State> state) : state_(std::move(state)) {}
ReferenceScene::ReferenceScene(ReferenceScene&&) noexcept = default;
ReferenceScene& ReferenceScene::operator=(ReferenceScene&&) noexcept = default;
ReferenceScene::~ReferenceScene() = default;

const Mesh& ReferenceScene::mesh() const { return state_->mesh; }
const RayScene& ReferenceScene::rays() const { return *state_->rays; }
const DirectLight& ReferenceScene::light() const { return *state_->light; }

Result<ReferenceScene> ReferenceScene::load(const std::vector<std::string>& meshes,
                                            const Surroundings& surroundings, int threads,
                                            Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkSurroundings(surroundings));
  auto state = std::make_unique<State>();
  SURFEIT_ASSIGN_OR_RETURN(state->mesh, loadScene(meshes, surroundings, progress));
  SURFEIT_ASSIGN_OR_RETURN(RayScene rays, RayScene::build(state->mesh, threads));
  state->rays.emplace(std::move(rays));
  state->light.emplace(state->mesh, *state->rays, surroundings.lights);
  return ReferenceScene(std::move(state));
}

glm::vec3 ReferenceScene::rayOrigin(const glm::dvec3& position, const glm::vec3& normal,
                                    float offset) const {
  const float diagonal = glm::length(state_->rays->bounds().extent());
  return glm::vec3(position - state_->mesh.origin) +
         normal * (offset > 0 ? offset : 1e-4f * diagonal);
}

ReferenceGather ReferenceScene::gather(const glm::dvec3& position, const glm::vec3& normal,
                                       std::uint64_t seed, const ReferenceQuality& quality) const {
  if (!state_->mesh.hasTints()) {
    return gatherColor(position, normal, seed, quality, RayScene::kNoColor);
  }
  ReferenceGather all;
  for (int color = 0; color < 3; ++color) {
    const ReferenceGather one = gatherColor(position, normal, seed, quality, std::uint32_t(color));
    all.occlusion_front += one.occlusion_front / 3;
    all.occlusion_both += one.occlusion_both / 3;
    all.irradiance_front[color] = one.irradiance_front[color];
    all.irradiance_both[color] = one.irradiance_both[color];
  }
  return all;
}

ReferenceGather ReferenceScene::gatherColor(const glm::dvec3& position, const glm::vec3& normal,
                                            std::uint64_t seed, const ReferenceQuality& quality,
                                            std::uint32_t color) const {
  const RayScene& rays = *state_->rays;
  const glm::vec3 start = rayOrigin(position, normal, quality.offset);
  const CosineDirections directions(normal, quality.rays, seed);
  ReferenceGather sum;
  int front = 0, both = 0;
  for (int i = 0; i < quality.rays; ++i) {
    const glm::vec3 direction = directions[i];
    float begin = 0;
    // A scene of more layers than this before the first front does not occur; a ray caught in
    // coplanar triangles does
    constexpr int kMaxLayers = 64;
    for (int layer = 0; layer < kMaxLayers; ++layer) {
      const auto hit = rays.closestHit(start, direction, begin, quality.max_distance, color);
      if (!hit) break;
      if (layer == 0) ++both;
      const SurfacePoint point = surfacePoint(state_->mesh, hit->triangle, hit->u, hit->v);
      if (glm::dot(point.geometric_normal, direction) < 0) {
        ++front;
        if (state_->light->hasLight()) {
          const std::uint64_t hit_seed = splitMix(seed) + std::uint64_t(i);
          const glm::vec3 exitance =
              state_->light->exitance(point, hit_seed, quality.light_samples);
          sum.irradiance_front += exitance;
          if (layer == 0) sum.irradiance_both += exitance;
        }
        break;
      }
      begin = std::nextafter(hit->distance + 0.1f * rays.surfaceOffset(), 1e30f);
    }
  }

  // E = pi times the mean radiance over cosine-weighted rays = the mean exitance B = pi L
  const float weight = 1 / float(quality.rays);
  sum.occlusion_front = float(front) * weight;
  sum.occlusion_both = float(both) * weight;
  sum.irradiance_front *= weight;
  sum.irradiance_both *= weight;
  return sum;
}

float ReferenceScene::occlusion(const glm::dvec3& position, const glm::vec3& normal,
                                std::uint64_t seed, const ReferenceQuality& quality) const {
  const glm::vec3 start = rayOrigin(position, normal, quality.offset);
  const CosineDirections directions(normal, quality.rays, seed);
  int hits = 0;
  for (int i = 0; i < quality.rays; ++i) {
    hits += state_->rays->isOccluded(start, directions[i], 0, quality.max_distance) ? 1 : 0;
  }
  return float(hits) / float(quality.rays);
}

}  // namespace surfeit
