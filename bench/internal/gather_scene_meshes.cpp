#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <glm/geometric.hpp>
#include <optional>
#include <vector>

#include "bench/internal/gather_scene_geometry.h"
#include "storage/file.h"
#include "surfeit/sample.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

struct MeshScene {
  const char* name;
  const char* file;    // below the data directory
  int ground_up_axis;  // -1: no ground
  bool is_two_sided;
  float ray_offset;  // over the largest extent of the mesh
  float wavelength;  // likewise
};

// Ribbons of hair are a thousandth of the scene wide.
constexpr std::array kMeshScenes = {
    MeshScene{"bunny", "meshes/bunny.ply", 1, false, 1e-4f, 0.25f},
    MeshScene{"lion", "meshes/lion_reconstruction.ply", 2, false, 1e-4f, 0.25f},
    MeshScene{"sponza", "scenes/sponza/sponza.obj", -1, false, 3e-5f, 0.1f},
    MeshScene{"hair", "hair/straight_ribbons.ply", -1, true, 2e-6f, 0.1f},
    MeshScene{"koala", "meshes/koala.ply", 2, false, 1e-4f, 0.25f},
    MeshScene{"scan", "meshes/koala.ply", 2, false, 1e-4f, 0.25f},
    MeshScene{"igea", "meshes/igea.ply", 1, false, 1e-4f, 0.25f},
    MeshScene{"dragon", "meshes/dragon_res2.ply", 1, false, 1e-4f, 0.25f},
    MeshScene{"cornell", "scenes/cornell_box/cornell_box.obj", -1, false, 3e-5f, 0.5f},
};
constexpr std::uint64_t kSurfels = 2'000'000;
constexpr float kGroundSize = 1;  // over the diagonal: about half of the surfels are the object's

const MeshScene* findMeshScene(const std::string& name) {
  for (const MeshScene& scene : kMeshScenes) {
    if (name == scene.name) return &scene;
  }
  return nullptr;
}

// Turns every triangle so that its front is on the side of its shading normals, and forgets these
// and the colours: surfels are then as flat as what rays are traced against.
void turnTriangles(Mesh& mesh) {
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    const SurfacePoint point = surfacePoint(mesh, std::uint32_t(i), 1.f / 3, 1.f / 3);
    glm::uvec3& corners = mesh.triangle[i];
    const glm::vec3& a = mesh.position[corners.x];
    const glm::vec3 across = glm::cross(mesh.position[corners.y] - a, mesh.position[corners.z] - a);
    if (glm::dot(across, point.geometric_normal) < 0) std::swap(corners.y, corners.z);
  }
  mesh.normal.clear();
  mesh.color.clear();
  mesh.uv.clear();
}

// Positions and triangles as binary PLY, exactly as they are.
Status writeMesh(const Mesh& mesh, const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  const std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float "
      "y\nproperty float z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
      mesh.position.size(), mesh.triangle.size());
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(header))));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(mesh.position))));
  constexpr std::size_t kFaceBytes = 1 + sizeof(glm::uvec3);
  std::vector<std::byte> faces(mesh.triangle.size() * kFaceBytes);
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    faces[i * kFaceBytes] = std::byte{3};
    std::memcpy(&faces[i * kFaceBytes + 1], &mesh.triangle[i], sizeof(glm::uvec3));
  }
  SURFEIT_RETURN_IF_ERROR(file.append(faces));
  return file.commit();
}

}  // namespace

bool isMeshScene(const std::string& name) { return findMeshScene(name) != nullptr; }

std::string meshSceneFile(const std::string& name, const std::string& data) {
  return fmt::format("{}/{}", data, findMeshScene(name)->file);
}

Result<SceneGeometry> loadMeshScene(const std::string& name, const std::string& data,
                                    Progress& progress) {
  const MeshScene& scene = *findMeshScene(name);
  SceneGeometry geometry;
  SURFEIT_ASSIGN_OR_RETURN(geometry.mesh,
                           loadMeshes({meshSceneFile(name, data)}, glm::vec3(0.5f), progress));
  turnTriangles(geometry.mesh);
  const glm::vec3 extent = geometry.mesh.bounds().extent();
  const float size = std::max({extent.x, extent.y, extent.z});
  if (scene.ground_up_axis >= 0) {
    addGroundPlane({.enabled = true, .up = UpAxis(scene.ground_up_axis), .size = kGroundSize},
                   geometry.mesh);
  }
  geometry.exact_triangles = geometry.mesh.triangle.size();
  geometry.is_two_sided = scene.is_two_sided;
  geometry.ray_offset = scene.ray_offset * size;
  geometry.color_wavelength = scene.wavelength * size;
  geometry.surfels = kSurfels;
  return geometry;
}

Status sendMeshSurfels(const SceneGeometry& geometry, std::uint64_t count, const std::string& path,
                       int threads, const SurfelSink& sink) {
  const std::string mesh_path = path + ".turned.ply", cloud_path = path + ".sampled.ply";
  SURFEIT_RETURN_IF_ERROR(writeMesh(geometry.mesh, mesh_path));
  Progress quiet;
  SampleOptions options;
  options.count = count;
  options.threads = threads;
  options.is_two_sided = geometry.is_two_sided;
  SURFEIT_ASSIGN_OR_RETURN(const SampleStats stats,
                           sampleMeshes({mesh_path}, cloud_path, options, quiet));
  static_cast<void>(stats);

  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SurfelSource> source,
                           openSurfelSource(cloud_path, true));
  std::vector<Surfel> run(65536);
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t read, source->read(run));
    if (read == 0) break;
    for (Surfel& surfel : std::span(run).first(read)) {
      surfel.radiosity = radiosityAt(geometry, 0, surfel.position);
    }
    SURFEIT_RETURN_IF_ERROR(sink(std::span(run).first(read)));
  }
  std::filesystem::remove(mesh_path);
  std::filesystem::remove(cloud_path);
  return {};
}

}  // namespace surfeit
