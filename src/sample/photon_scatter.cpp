#include "sample/photon_scatter.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

// Paths end also where nothing is absorbed: the powers of those that go on grow instead.
constexpr float kMostSurvival = 0.97f;

float largest(const glm::vec3& rgb) { return std::max({rgb.x, rgb.y, rgb.z}); }

// From the side of the surface that `normal` points to.
glm::vec3 diffuseDirection(const glm::vec3& shading, const glm::vec3& geometric,
                           PhotonRandom& random) {
  glm::vec3 direction = cosineDirection(shading, random);
  // Shading normals lean over their surface's edge: what would pass into it stays above
  const float height = glm::dot(direction, geometric);
  if (height < 0) direction -= 2 * height * geometric;
  return direction;
}

glm::vec3 reflected(const glm::vec3& direction, const glm::vec3& normal) {
  return glm::normalize(direction - 2 * glm::dot(direction, normal) * normal);
}

// Glass reflects or refracts by chance, so powers stay as they are but for the color of the glass,
// which tints what enters.
std::optional<ScatterKind> scatterInGlass(const ScatterPoint& at, float offset,
                                          PhotonRandom& random, PhotonRay& ray) {
  const float side = at.is_back ? -1.0f : 1.0f;
  const glm::vec3 geometric = side * at.point.geometric_normal;
  glm::vec3 normal = side * at.point.normal;
  if (glm::dot(normal, ray.direction) >= 0) normal = geometric;  // it leans away from the photon
  const float eta = at.is_back ? at.material->index : 1 / at.material->index;
  const float cos_in = -glm::dot(ray.direction, normal);
  if (random.next() < fresnelReflectance(cos_in, eta)) {
    ray.direction = reflected(ray.direction, normal);
    if (glm::dot(ray.direction, geometric) < 0) ray.direction = reflected(ray.direction, geometric);
    ray.origin = at.point.position + offset * geometric;
  } else {
    const float cos_out = std::sqrt(std::max(0.0f, 1 - eta * eta * (1 - cos_in * cos_in)));
    ray.direction = glm::normalize(eta * ray.direction + (eta * cos_in - cos_out) * normal);
    const float height = glm::dot(ray.direction, geometric);
    if (height > 0) ray.direction -= 2 * height * geometric;
    ray.origin = at.point.position - offset * geometric;
    if (!at.is_back) ray.power *= at.material->transmission;
  }
  const float before = largest(ray.power);
  if (!(before > 0) || !(random.next() < kMostSurvival)) return std::nullopt;
  ray.power /= kMostSurvival;
  return ScatterKind::kSpecular;
}

}  // namespace

float fresnelReflectance(float cos_theta, float eta) {
  const float sine_sq = eta * eta * (1 - cos_theta * cos_theta);
  if (sine_sq >= 1) return 1;  // total reflection
  const float cos_out = std::sqrt(1 - sine_sq);
  const float parallel = (cos_theta - eta * cos_out) / (cos_theta + eta * cos_out);
  const float perpendicular = (eta * cos_theta - cos_out) / (eta * cos_theta + cos_out);
  return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

bool storesPhotons(const ScatterPoint& at) {
  switch (at.material->scattering) {
    case Scattering::kGlass:
      return false;
    case Scattering::kMirror:
      return largest(at.point.albedo) > 0;
    case Scattering::kMatte:
    case Scattering::kTranslucent:
      break;
  }
  return true;
}

bool scattersSide(const ScatterPoint& at) {
  return !at.is_back || at.material->scattering == Scattering::kGlass ||
         at.material->scattering == Scattering::kTranslucent;
}

std::optional<ScatterKind> scatter(const ScatterPoint& at, float offset, PhotonRandom& random,
                                   PhotonRay& ray) {
  const Material& material = *at.material;
  if (material.scattering == Scattering::kGlass) return scatterInGlass(at, offset, random, ray);

  // One way of several, each as often as it has power; what is left over is absorbed
  const float before = largest(ray.power);
  const glm::vec3 diffuse = ray.power * at.point.albedo;
  const bool has_other = material.scattering != Scattering::kMatte;
  const glm::vec3& factor =
      material.scattering == Scattering::kMirror ? material.specular : material.transmission;
  const glm::vec3 other = has_other ? ray.power * factor : glm::vec3(0);
  const float sum = (largest(diffuse) + largest(other)) / before;
  if (!(sum > 0)) return std::nullopt;
  const float scale = std::min(1.0f, kMostSurvival / sum) / before;
  const float chance_diffuse = scale * largest(diffuse), chance_other = scale * largest(other);
  const float number = random.next();
  if (!(number < chance_diffuse + chance_other)) return std::nullopt;

  const float side = at.is_back ? -1.0f : 1.0f;
  const glm::vec3 geometric = side * at.point.geometric_normal, shading = side * at.point.normal;
  ray.origin = at.point.position + offset * geometric;
  if (number < chance_diffuse) {
    ray.power = diffuse / chance_diffuse;
    ray.direction = diffuseDirection(shading, geometric, random);
    return ScatterKind::kDiffuse;
  }
  ray.power = other / chance_other;
  if (material.scattering == Scattering::kTranslucent) {
    ray.origin = at.point.position - offset * geometric;
    ray.direction = diffuseDirection(-shading, -geometric, random);
    return ScatterKind::kDiffuse;
  }
  ray.direction = reflected(ray.direction, shading);
  if (glm::dot(ray.direction, geometric) < 0) ray.direction = reflected(ray.direction, geometric);
  return ScatterKind::kSpecular;
}

}  // namespace surfeit
