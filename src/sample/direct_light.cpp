#include "sample/direct_light.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "core/luminance.h"
#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// Van der Corput sequence in base 2.
float radicalInverse(std::uint32_t i) {
  std::uint32_t reversed = 0;
  for (int bit = 0; bit < 32; ++bit, i >>= 1) reversed = (reversed << 1) | (i & 1);
  return float(reversed >> 8) * 0x1p-24f;
}

float fraction(float value) { return value - std::floor(value); }

// Sample i of n in the unit square: Hammersley points shifted by two hashes of the seed
// (Cranley and Patterson 1976), so that each surfel has its own but well spread pattern.
struct Pattern {
  Pattern(std::uint64_t seed, int sample_count) : count(sample_count) {
    const std::uint64_t bits = splitMix(seed);
    shift_u = float(bits >> 40) * 0x1p-24f;
    shift_v = float((bits >> 8) & 0xffffff) * 0x1p-24f;
  }
  float u(int i) const { return std::min((float(i) + shift_u) / float(count), 0x1.fffffep-1f); }
  float v(int i) const { return fraction(radicalInverse(std::uint32_t(i)) + shift_v); }

  int count;
  float shift_u, shift_v;
};

// Part of the mean in what chooses an emissive triangle; the rest is the most that it may send.
constexpr float kMeanShare = 0.95f;

// The cosine with which light arrives from there, times the length of `towards`. All sides of a
// sphere together: its cross-section is a quarter of its surface.
float arrival(const SurfacePoint& point, const glm::vec3& towards) {
  if (point.normal == glm::vec3(0)) return 0.25f * glm::length(towards);
  return glm::dot(towards, point.normal);
}

}  // namespace

Lights countedFrom(Lights lights, const glm::dvec3& origin) {
  for (PointLight& light : lights.points) light.position -= origin;
  for (AreaLight& light : lights.areas) light.centre -= origin;
  return lights;
}

DirectLight::DirectLight(const Mesh& mesh, const RayScene* scene, const Lights& lights)
    : mesh_(mesh),
      scene_(scene),
      lights_(countedFrom(lights, mesh.origin)),
      offset_(scene != nullptr ? scene->surfaceOffset() : 0) {
  // Triangles emit in proportion to area and luminance, so they are chosen that way
  double sum = 0;
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    // Where a texture glows brighter than on the average is chosen often enough, too
    const glm::vec3& most = mesh.materials[mesh.triangle_material[i]].emission;
    const glm::vec3 emission = glm::mix(most, meanEmission(mesh, std::uint32_t(i)), kMeanShare);
    const double power = double(luminance(emission)) * triangleArea(mesh, std::uint32_t(i));
    if (!(power > 0)) continue;
    sum += power;
    emissive_.push_back(std::uint32_t(i));
    emissive_power_sum_.push_back(sum);
    max_emission_ = glm::max(max_emission_, most);
  }
}

// What light has there beside the physical 1 / d^2.
float DirectLight::falloffAt(float distance_sq) const {
  if (lights_.falloff == 2) return 1;
  const auto reference = float(lights_.falloff_distance);
  return std::pow(distance_sq / (reference * reference), 1 - 0.5f * lights_.falloff);
}

glm::vec3 DirectLight::rayOrigin(const SurfacePoint& point) const {
  return point.position + (offset_ + point.lift) * point.geometric_normal;
}

glm::vec3 DirectLight::passedLight(const SurfacePoint& point, const glm::vec3& target) const {
  if (scene_ == nullptr) return glm::vec3(1);
  const glm::vec3 origin = rayOrigin(point);
  return scene_->passedLight(origin, target - origin, 0, 1 - 1e-5f);
}

// Light from a small piece of an emitter, per unit of its area: L cos cos' / d^2.
glm::vec3 DirectLight::fromEmitterPoint(const SurfacePoint& point, const glm::vec3& position,
                                        const glm::vec3& normal, const glm::vec3& radiance,
                                        float falloff) const {
  const glm::vec3 towards = position - point.position;
  const float distance_sq = glm::dot(towards, towards);
  if (!(distance_sq > 0)) return glm::vec3(0);
  const float arriving = arrival(point, towards);
  const float cosines = arriving * -glm::dot(towards, normal);
  if (arriving <= 0 || cosines <= 0) return glm::vec3(0);
  const glm::vec3 passed = passedLight(point, position + offset_ * normal);
  return passed * radiance * (falloff * (cosines / (distance_sq * distance_sq)));
}

glm::vec3 DirectLight::fromAreaLight(const AreaLight& light, const SurfacePoint& point,
                                     std::uint64_t seed, int samples) const {
  const glm::vec3 cross = glm::cross(light.u, light.v);
  const float quarter_area = glm::length(cross);
  const glm::vec3 normal = cross / quarter_area;
  const Pattern pattern(seed, samples);
  glm::vec3 sum(0);
  float most_falloff = 0;
  for (int i = 0; i < samples; ++i) {
    const glm::vec3 position = glm::vec3(light.centre) + (2 * pattern.u(i) - 1) * light.u +
                               (2 * pattern.v(i) - 1) * light.v;
    const glm::vec3 towards = position - point.position;
    const float falloff = falloffAt(glm::dot(towards, towards));
    most_falloff = std::max(most_falloff, falloff);
    sum += fromEmitterPoint(point, position, normal, light.radiance, falloff);
  }
  // 1 / d^2 has no bound for samples next to the light, but irradiance has: pi L
  return glm::min(sum * (4 * quarter_area / float(samples)), kPi * most_falloff * light.radiance);
}

glm::vec3 DirectLight::fromEmissiveTriangles(const SurfacePoint& point, std::uint64_t seed,
                                             int samples) const {
  const double total = emissive_power_sum_.back();
  const Pattern pattern(seed, samples);
  glm::vec3 sum(0);
  for (int i = 0; i < samples; ++i) {
    // The place along the summed power chooses the triangle, and how far into its share a
    // coordinate within it, which keeps the pattern stratified over both
    const double target = double(pattern.u(i)) * total;
    const auto chosen =
        std::upper_bound(emissive_power_sum_.begin(), emissive_power_sum_.end() - 1, target);
    const std::size_t index = std::size_t(chosen - emissive_power_sum_.begin());
    const double begin = index > 0 ? emissive_power_sum_[index - 1] : 0;
    const double power = *chosen - begin;
    const float u = std::clamp(float((target - begin) / power), 0.0f, 1.0f);

    // Uniform on the triangle: 1 - sqrt(u) weighs the first corner
    const float root = std::sqrt(u);
    const std::uint32_t triangle = emissive_[index];
    const SurfacePoint light =
        surfacePoint(mesh_, triangle, root * (1 - pattern.v(i)), root * pattern.v(i));
    const double probability_per_area = power / total / triangleArea(mesh_, triangle);
    sum += fromEmitterPoint(
        point, light.position, light.geometric_normal,
        light.emission * light.opacity * float(1 / (double(kPi) * probability_per_area)), 1);
  }
  return glm::min(sum / float(samples), max_emission_);  // bounded as above: pi L is the exitance
}

glm::vec3 DirectLight::irradiance(const SurfacePoint& point, std::uint64_t seed,
                                  int samples) const {
  glm::vec3 sum(0);
  for (const PointLight& light : lights_.points) {
    const glm::vec3 position(light.position), towards = position - point.position;
    const float distance_sq = glm::dot(towards, towards);
    const float cos_theta = arrival(point, towards) / std::sqrt(distance_sq);
    if (!(cos_theta > 0)) continue;
    sum += passedLight(point, position) * light.intensity *
           (falloffAt(distance_sq) * (cos_theta / distance_sq));
  }
  for (const DirectionalLight& light : lights_.directionals) {
    const glm::vec3 towards = -glm::normalize(light.direction);
    const float cos_theta = arrival(point, towards);
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    if (!(cos_theta > 0)) continue;
    const glm::vec3 passed = scene_ != nullptr
                                 ? scene_->passedLight(rayOrigin(point), towards, 0, kInfinity)
                                 : glm::vec3(1);
    sum += passed * light.irradiance * cos_theta;
  }
  for (std::size_t i = 0; i < lights_.areas.size(); ++i) {
    sum += fromAreaLight(lights_.areas[i], point, splitMix(seed) + i, samples);
  }
  if (!emissive_.empty()) sum += fromEmissiveTriangles(point, splitMix(~seed), samples);
  return sum;
}

}  // namespace surfeit
