#include "sample/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <limits>
#include <new>

#include "io/file.h"

namespace surfeit {
namespace {

bool isFinite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

template <typename T>
std::uint64_t bytesOf(const std::vector<T>& values) {
  return values.capacity() * sizeof(T);
}

// Gives vertices that came without an attribute that others have its neutral value, and Embree
// the room that it reads into.
void completeAttributes(Mesh& mesh) {
  const std::size_t count = mesh.position.size();
  if (!mesh.normal.empty()) mesh.normal.resize(count, glm::vec3(0));
  if (!mesh.color.empty()) mesh.color.resize(count, glm::vec3(1));
  if (!mesh.uv.empty()) mesh.uv.resize(count, glm::vec2(0));
  mesh.position.reserve(count + 1);
}

// Tells when floats hold vertices worse than to a thousandth of the size of triangles.
void noteFarVertices(const std::string& path, const Mesh& mesh, Progress& progress) {
  const glm::vec3 sides = mesh.bounds().extent();
  const double size =
      double(std::max({sides.x, sides.y, sides.z})) / std::sqrt(double(mesh.triangle.size()));
  const double step = floatStep(movedBounds(mesh.bounds(), glm::dvec3(0)));
  if (step <= 1e-3 * size) return;
  progress.note(fmt::format(
      "{}: vertices are taken as floats, which stand {:.2g} apart so far from 0, beside "
      "triangles of about {:.2g}: move the mesh near 0",
      path, step, size));
}

enum class MeshFormat { kPly, kObj, kUnknown };

// PLY by its magic; OBJ has none, so that its name must tell.
Result<MeshFormat> recogniseMesh(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  char magic[3] = {};
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           file.readSome(0, std::as_writable_bytes(std::span(magic))));
  if (count == 3 && magic[0] == 'p' && magic[1] == 'l' && magic[2] == 'y') return MeshFormat::kPly;
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".obj" || extension == ".OBJ") return MeshFormat::kObj;
  return MeshFormat::kUnknown;
}

}  // namespace

Bounds3 Mesh::bounds() const {
  Bounds3 bounds;
  for (const glm::uvec3& corners : triangle) {
    for (int i = 0; i < 3; ++i) bounds.add(position[corners[i]]);
  }
  return bounds;
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
  if (!mesh.color.empty()) point.albedo *= interpolate(mesh.color);
  if (material.texture != kNoTexture && !mesh.uv.empty()) {
    point.albedo *= mesh.textures[material.texture].lookup(interpolate(mesh.uv));
  }
  return point;
}

Status addFace(std::span<const std::uint64_t> corners, std::uint32_t material,
               std::uint64_t vertex_begin, const std::string& path, std::uint64_t face,
               Mesh& mesh) {
  for (const std::uint64_t corner : corners) {
    if (corner < vertex_begin || corner >= mesh.position.size()) {
      return Status::corruption(fmt::format("{}: face {}: vertex {}, expected 0 to {}", path, face,
                                            std::int64_t(corner - vertex_begin),
                                            std::int64_t(mesh.position.size() - vertex_begin) - 1));
    }
    if (!isFinite(mesh.position[corner])) {
      return Status::corruption(
          fmt::format("{}: face {}: vertex {} is not finite", path, face, corner - vertex_begin));
    }
  }
  if (mesh.triangle.size() + corners.size() >= std::numeric_limits<std::uint32_t>::max()) {
    return Status::failed(fmt::format("{}: face {}: more than 2^32 triangles", path, face));
  }

  bool has_area = false;
  for (std::size_t i = 2; i < corners.size(); ++i) {
    mesh.triangle.emplace_back(std::uint32_t(corners[0]), std::uint32_t(corners[i - 1]),
                               std::uint32_t(corners[i]));
    if (triangleArea(mesh, std::uint32_t(mesh.triangle.size() - 1)) > 0) {
      mesh.triangle_material.push_back(material);
      has_area = true;
    } else {
      mesh.triangle.pop_back();
    }
  }
  if (!has_area) ++mesh.degenerate_faces;
  return {};
}

Result<Mesh> loadMeshes(const std::vector<std::string>& paths, const glm::vec3& default_albedo,
                        Progress& progress) {
  if (paths.empty()) return Status::invalidArgument("no mesh given");
  Mesh mesh;
  try {
    for (const std::string& path : paths) {
      const std::size_t triangles_before = mesh.triangle.size();
      const std::uint64_t degenerate_before = mesh.degenerate_faces;
      SURFEIT_ASSIGN_OR_RETURN(const MeshFormat format, recogniseMesh(path));
      switch (format) {
        case MeshFormat::kPly:
          SURFEIT_RETURN_IF_ERROR(loadPlyMesh(path, default_albedo, mesh));
          break;
        case MeshFormat::kObj:
          SURFEIT_RETURN_IF_ERROR(loadObjMesh(path, default_albedo, mesh, progress));
          break;
        case MeshFormat::kUnknown:
          return Status::corruption(fmt::format(
              "{}: not a mesh that we read: expected PLY or a name ending in .obj", path));
      }
      completeAttributes(mesh);
      const std::uint64_t degenerate = mesh.degenerate_faces - degenerate_before;
      if (mesh.triangle.size() == triangles_before) {
        return Status::corruption(
            fmt::format("{}: no triangles ({} faces without area)", path, degenerate));
      }
      noteFarVertices(path, mesh, progress);
      if (degenerate > 0) {
        progress.note(fmt::format("{}: {} faces without area skipped", path, degenerate));
      }
    }
  } catch (const std::bad_alloc&) {
    return Status::failed(
        fmt::format("{}: out of memory after {} triangles", paths.front(), mesh.triangle.size()));
  }
  return mesh;
}

void addGroundPlane(const GroundPlane& ground, Mesh& mesh) {
  if (!ground.enabled) return;
  const Bounds3 bounds = mesh.bounds();
  const float diagonal = glm::length(bounds.extent());
  const int up = ground.up_axis, first = (up + 1) % 3, second = (up + 2) % 3;

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
  completeAttributes(mesh);

  const std::uint32_t material = std::uint32_t(mesh.materials.size());
  mesh.materials.push_back({ground.albedo, glm::vec3(0), kNoTexture});
  mesh.triangle.emplace_back(base, base + 1, base + 2);
  mesh.triangle.emplace_back(base, base + 2, base + 3);
  mesh.triangle_material.insert(mesh.triangle_material.end(), 2, material);
}

}  // namespace surfeit
