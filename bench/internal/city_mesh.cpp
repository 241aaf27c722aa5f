// The generated city (docs/generate.md) as triangles, around a place: what `surfeit sample` takes.
// Leaves are squares of their area, one of every `share` of them and larger by as much.
//
//   city_mesh X Y RADIUS SHARE OUTPUT.ply
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "core/square_strata.h"
#include "core/tangent_frame.h"
#include "surfels/generated/scene_surfaces.h"

namespace {

using namespace surfeit;

struct Vertex {
  glm::vec3 position, color;
};

class CityMesh {
 public:
  void add(const Surface& surface, std::uint64_t key, std::uint32_t share) {
    switch (surface.shape) {
      case SurfaceShape::kBilinear:
        return addGrid(1, surface.albedo, [&](float u, float v) {
          return surface.origin + u * surface.edge_u + v * surface.edge_v + u * v * surface.edge_w;
        });
      case SurfaceShape::kHemisphere:
        return addGrid(24, surface.albedo, [&](float u, float v) {
          const float angle = 6.2831853f * u, height = v;
          const float ring = std::sqrt(std::max(0.0f, 1 - height * height));
          return surface.origin + ring * std::cos(angle) * surface.edge_u +
                 ring * std::sin(angle) * surface.edge_v + height * surface.edge_w;
        });
      case SurfaceShape::kCrown:
        return addLeaves(surface, key, share);
      case SurfaceShape::kHaze:
        break;
    }
  }

  bool write(const std::string& path) const {
    std::ofstream file(path, std::ios::binary);
    file << fmt::format(
        "ply\nformat binary_little_endian 1.0\ncomment up z\nelement vertex {}\nproperty float x\n"
        "property float y\nproperty float z\nproperty float red\nproperty float green\n"
        "property float blue\nelement face {}\nproperty list uchar int vertex_indices\n"
        "end_header\n",
        vertices_.size(), vertices_.size() / 4);
    file.write(reinterpret_cast<const char*>(vertices_.data()),
               std::streamsize(vertices_.size() * sizeof(Vertex)));
    for (std::uint32_t first = 0; first + 3 < vertices_.size(); first += 4) {
      const std::array<std::uint32_t, 4> corners{first, first + 1, first + 2, first + 3};
      file.put(4);
      file.write(reinterpret_cast<const char*>(corners.data()), sizeof corners);
    }
    return bool(file);
  }

  std::size_t faces() const { return vertices_.size() / 4; }

 private:
  void addQuad(const std::array<glm::vec3, 4>& corners, const glm::vec3& color) {
    for (const glm::vec3& corner : corners) vertices_.push_back({corner, color});
  }

  template <typename Place>
  void addGrid(int cells, const glm::vec3& color, Place&& place) {
    for (int i = 0; i < cells; ++i) {
      for (int k = 0; k < cells; ++k) {
        const float u = float(k) / float(cells), v = float(i) / float(cells);
        const float w = 1 / float(cells);
        addQuad({place(u, v), place(u + w, v), place(u + w, v + w), place(u, v + w)}, color);
      }
    }
  }

  void addLeaves(const Surface& crown, std::uint64_t key, std::uint32_t share) {
    const float half = 0.5f * crown.leaf_radius * std::sqrt(3.14159265f * float(share));
    for (std::uint32_t i = 0; i < crown.leaves; i += share) {
      const auto unit = [&](std::uint64_t n, int shift) {
        return float(unitFromBits(hashOf(key, 8 * std::uint64_t(i) + n), shift));
      };
      const float z = 2 * unit(0, 0) - 1, angle = 6.2831853f * unit(0, 16);
      const float ring = std::sqrt(std::max(0.0f, 1 - z * z)), reach = std::cbrt(unit(0, 32));
      const glm::vec3 middle =
          crown.origin + reach * (ring * std::cos(angle) * crown.edge_u +
                                  ring * std::sin(angle) * crown.edge_v + z * crown.edge_w);
      const float nz = 2 * unit(1, 0) - 1, turn = 6.2831853f * unit(1, 16);
      const float flat = std::sqrt(std::max(0.0f, 1 - nz * nz));
      const TangentFrame frame(glm::vec3(flat * std::cos(turn), flat * std::sin(turn), nz));
      const glm::vec3 u = half * frame.tangent, v = half * frame.bitangent;
      addQuad({middle - u - v, middle + u - v, middle + u + v, middle - u + v}, crown.albedo);
    }
  }

  std::vector<Vertex> vertices_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) {
    fmt::print(stderr, "usage: city_mesh X Y RADIUS SHARE OUTPUT.ply\n");
    return 64;
  }
  const double x = std::atof(argv[1]), y = std::atof(argv[2]), radius = std::atof(argv[3]);
  const std::uint32_t share = std::uint32_t(std::max(1, std::atoi(argv[4])));
  CityMesh mesh;
  std::uint64_t key = 0;
  for (const Surface& surface : makeSceneSurfaces(SceneKind::kCity, 1)) {
    ++key;
    const double dx = double(surface.origin.x) - x, dy = double(surface.origin.y) - y;
    if (std::hypot(dx, dy) <= radius) mesh.add(surface, mixBits(key), share);
  }
  if (!mesh.write(argv[5])) {
    fmt::print(stderr, "city_mesh: {} cannot be written\n", argv[5]);
    return 74;
  }
  fmt::print("{}: {} quads\n", argv[5], mesh.faces());
  return 0;
}
