#include "sample/meshes/mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace surfeit {
namespace {

template <typename T>
std::uint64_t bytesOf(const std::vector<T>& values) {
  return values.capacity() * sizeof(T);
}

}  // namespace

Bounds3 Mesh::bounds() const {
  Bounds3 bounds;
  for (const glm::uvec3& corners : triangle) {
    for (int i = 0; i < 3; ++i) bounds.add(position[corners[i]]);
  }
  return bounds;
}

bool Mesh::isOpaque() const {
  return std::all_of(materials.begin(), materials.end(),
                     [](const Material& material) { return material.isOpaque(); });
}

bool Mesh::isTranslucent() const {
  return std::any_of(materials.begin(), materials.end(), [](const Material& material) {
    return material.opacity != glm::vec3(0) && material.opacity != glm::vec3(1);
  });
}

bool Mesh::hasTints() const {
  return std::any_of(materials.begin(), materials.end(), [](const Material& material) {
    return material.opacity != glm::vec3(material.opacity.r);
  });
}

bool Mesh::hasTwoSides() const {
  return std::any_of(materials.begin(), materials.end(),
                     [](const Material& material) { return material.is_two_sided; });
}

void Mesh::completeAttributes() {
  const std::size_t count = position.size();
  if (!normal.empty()) normal.resize(count, glm::vec3(0));
  if (!color.empty()) color.resize(count, glm::vec3(1));
  if (!uv.empty()) uv.resize(count, glm::vec2(0));
  position.reserve(count + 1);
}

std::uint64_t Mesh::memoryBytes() const {
  return bytesOf(position) + bytesOf(normal) + bytesOf(color) + bytesOf(uv) + bytesOf(triangle) +
         bytesOf(triangle_material);
}

double triangleArea(const Mesh& mesh, std::uint32_t triangle) {
  const glm::uvec3& corners = mesh.triangle[triangle];
  const glm::dvec3 a(mesh.position[corners.x]);
  return 0.5 * glm::length(glm::cross(glm::dvec3(mesh.position[corners.y]) - a,
                                      glm::dvec3(mesh.position[corners.z]) - a));
}

glm::vec3 opacityAt(const Mesh& mesh, std::uint32_t triangle, float u, float v) {
  const Material& material = mesh.materials[mesh.triangle_material[triangle]];
  if (material.mask == kNoTexture || mesh.uv.empty()) return material.opacity;
  const glm::uvec3& corners = mesh.triangle[triangle];
  const glm::vec2 uv =
      mesh.uv[corners.x] * (1.0f - u - v) + mesh.uv[corners.y] * u + mesh.uv[corners.z] * v;
  return material.opacity * mesh.masks[material.mask].lookup(uv);
}

glm::vec3 meanEmission(const Mesh& mesh, std::uint32_t triangle) {
  const Material& material = mesh.materials[mesh.triangle_material[triangle]];
  if (material.glow == kNoTexture || mesh.uv.empty()) return material.emission;
  const glm::uvec3& corners = mesh.triangle[triangle];
  const glm::vec2 a = mesh.uv[corners.x], b = mesh.uv[corners.y] - a, c = mesh.uv[corners.z] - a;
  const Texture& glow = mesh.textures[material.glow];

  // The middles of rows^2 triangles that tile this one; as many rows as it has texels, up to a
  // limit
  constexpr int kMostRows = 64;
  const glm::vec2 texels(glow.width(), glow.height());
  const float longest =
      std::max({glm::length(b * texels), glm::length(c * texels), glm::length((c - b) * texels)});
  const int rows = int(std::clamp(2 * longest, 1.0f, float(kMostRows)));
  glm::dvec3 sum(0);
  for (int i = 0; i < rows; ++i) {
    for (int k = 0; k < rows - i; ++k) {
      const auto add = [&](float u, float v) {
        sum += glm::dvec3(glow.lookup(a + (u / float(rows)) * b + (v / float(rows)) * c));
      };
      add(float(i) + 1.0f / 3, float(k) + 1.0f / 3);
      if (k + 1 < rows - i) add(float(i) + 2.0f / 3, float(k) + 2.0f / 3);
    }
  }
  return material.emission * glm::vec3(sum / (double(rows) * rows));
}

SurfacePoint surfacePoint(const Mesh& mesh, std::uint32_t triangle, float u, float v) {
  const glm::uvec3& corners = mesh.triangle[triangle];
  const float w = 1.0f - u - v;
  const auto interpolate = [&](const auto& attribute) {
    return attribute[corners.x] * w + attribute[corners.y] * u + attribute[corners.z] * v;
  };

  // The cross product in double: thin triangles lose their direction in float
  SurfacePoint point;
  point.position = interpolate(mesh.position);
  const glm::dvec3 a(mesh.position[corners.x]);
  point.geometric_normal = glm::vec3(glm::normalize(glm::cross(
      glm::dvec3(mesh.position[corners.y]) - a, glm::dvec3(mesh.position[corners.z]) - a)));

  point.normal = point.geometric_normal;
  if (!mesh.normal.empty()) {
    const glm::vec3 normal = interpolate(mesh.normal);
    const float length = glm::length(normal);
    if (length > 1e-6f && std::isfinite(length)) {
      point.normal = normal / length;
      if (glm::dot(point.normal, point.geometric_normal) < 0) {
        point.geometric_normal = -point.geometric_normal;
      }
    }
  }

  const Material& material = mesh.materials[mesh.triangle_material[triangle]];
  point.albedo = material.albedo;
  point.emission = material.emission;
  if (!material.isOpaque()) point.opacity = opacityAt(mesh, triangle, u, v);
  if (!mesh.color.empty()) point.albedo *= interpolate(mesh.color);
  if (!mesh.uv.empty()) {
    if (material.texture != kNoTexture) {
      point.albedo *= mesh.textures[material.texture].lookup(interpolate(mesh.uv));
    }
    if (material.glow != kNoTexture) {
      point.emission *= mesh.textures[material.glow].lookup(interpolate(mesh.uv));
    }
  }
  return point;
}

void addGroundPlane(const GroundPlane& ground, Mesh& mesh) {
  if (!ground.enabled) return;
  const Bounds3 bounds = mesh.bounds();
  const float diagonal = glm::length(bounds.extent());
  const int up = int(ground.up), first = (up + 1) % 3, second = (up + 2) % 3;

  // (first, second, up) is right-handed, so this order of corners faces up
  glm::vec3 corner = bounds.centre();
  corner[up] = bounds.min[up] - 1e-4f * diagonal;
  const float half = 0.5f * ground.size * diagonal;
  const std::uint32_t base = std::uint32_t(mesh.position.size());
  constexpr float kSigns[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (const auto& sign : kSigns) {
    glm::vec3 position = corner;
    position[first] += sign[0] * half;
    position[second] += sign[1] * half;
    mesh.position.push_back(position);
  }
  mesh.completeAttributes();

  const std::uint32_t material = std::uint32_t(mesh.materials.size());
  mesh.materials.push_back({.albedo = ground.albedo});
  mesh.triangle.emplace_back(base, base + 1, base + 2);
  mesh.triangle.emplace_back(base, base + 2, base + 3);
  mesh.triangle_material.insert(mesh.triangle_material.end(), 2, material);
}

}  // namespace surfeit
