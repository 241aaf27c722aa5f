#include "bench/internal/gather_scene_geometry.h"

#include <cmath>

namespace surfeit {

namespace {
constexpr double kTwoPi = 6.283185307179586;
}

glm::vec3 radiosityAt(const SceneGeometry& geometry, std::uint32_t material,
                      const glm::vec3& position) {
  if (geometry.color_wavelength == 0) return geometry.mesh.materials[material].emission;
  const float k = float(kTwoPi) / geometry.color_wavelength;
  return {0.5f + 0.4f * std::sin(k * position.x), 0.5f + 0.4f * std::sin(k * position.y + 1),
          0.5f + 0.4f * std::sin(k * position.z + 2)};
}

void appendGrid(int columns, int rows, const std::function<glm::vec3(double, double)>& corner,
                std::uint32_t material, Mesh& mesh) {
  const std::uint32_t base = std::uint32_t(mesh.position.size());
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      mesh.position.push_back(corner(double(column) / columns, double(row) / rows));
    }
  }
  const auto at = [&](int column, int row) {
    return base + std::uint32_t(row * (columns + 1) + column);
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      mesh.triangle.emplace_back(at(column, row), at(column + 1, row), at(column + 1, row + 1));
      mesh.triangle.emplace_back(at(column, row), at(column + 1, row + 1), at(column, row + 1));
      mesh.triangle_material.insert(mesh.triangle_material.end(), 2, material);
    }
  }
}

void appendSphere(const TrueSphere& sphere, int around, Mesh& mesh) {
  const int from_pole_to_pole = (around + 1) / 2;
  const auto corner = [&](double u, double v) {
    const double longitude = kTwoPi * u, colatitude = 0.5 * kTwoPi * (1 - v);
    const glm::dvec3 direction(std::sin(colatitude) * std::cos(longitude),
                               std::sin(colatitude) * std::sin(longitude), std::cos(colatitude));
    return glm::vec3(glm::dvec3(sphere.centre) + double(sphere.radius) * direction);
  };
  appendGrid(around, from_pole_to_pole, corner, sphere.material, mesh);
}

}  // namespace surfeit
