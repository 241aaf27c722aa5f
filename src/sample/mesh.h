// Triangle meshes with materials, as they come from PLY and OBJ files: what surfels are cut from
// and what rays are traced against.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "sample/texture.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::uint32_t kNoTexture = ~std::uint32_t{0};

struct Material {
  glm::vec3 albedo{0.5f};              // Kd: diffuse reflectance, scene-linear
  glm::vec3 emission{0};               // radiant exitance: pi times the radiance Ke
  std::uint32_t texture = kNoTexture;  // into Mesh::textures; multiplies the albedo
};

// Triangles of one or several files. Vertex attributes are empty, or have one entry per position;
// a zero normal means "the triangle's own". Filled by the loaders, then immutable.
struct Mesh {
  std::vector<glm::vec3> position;  // world units; capacity for one more, so that Embree may read
                                    // 16 bytes at the last vertex
  std::vector<glm::vec3> normal;    // shading normals, any length
  std::vector<glm::vec3> color;     // scene-linear; multiplies the albedo
  std::vector<glm::vec2> uv;
  std::vector<glm::uvec3> triangle;              // vertices; counter-clockwise seen from the front
  std::vector<std::uint32_t> triangle_material;  // one per triangle
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::uint64_t degenerate_faces = 0;  // faces without area, skipped

  Bounds3 bounds() const;
  // Bytes held by the arrays.
  std::uint64_t memoryBytes() const;
};

// A place on a mesh, ready for shading. Both normals have unit length and agree on the front side:
// the geometric normal is turned to the side of the shading normal.
struct SurfacePoint {
  glm::vec3 position{0};
  glm::vec3 normal{0};
  glm::vec3 geometric_normal{0};
  glm::vec3 albedo{0};
  glm::vec3 emission{0};  // radiant exitance
};

// The point of a triangle with barycentric weights (1 - u - v, u, v).
SurfacePoint surfacePoint(const Mesh& mesh, std::uint32_t triangle, float u, float v);

// Area of a triangle, in double: sums over millions of triangles must stay exact.
double triangleArea(const Mesh& mesh, std::uint32_t triangle);

// Appends the face with those corners (indices into mesh.position), polygons as a fan. Faces
// without area are counted and skipped. kCorruption, naming the file and `face` (from 0), when a
// corner is no vertex or is not finite.
Status addFace(std::span<const std::uint64_t> corners, std::uint32_t material,
               std::uint64_t vertex_begin, const std::string& path, std::uint64_t face, Mesh& mesh);

// Reads meshes one after the other into one. PLY and OBJ are told apart by content and name.
// `default_albedo` is the reflectance of what has neither colors nor material. Notes tell of
// missing textures and skipped faces. kCorruption for files without any triangle.
Result<Mesh> loadMeshes(const std::vector<std::string>& paths, const glm::vec3& default_albedo,
                        Progress& progress);

// The readers behind loadMeshes; they append to `mesh`, and leave attributes that the file lacks as
// they were.
Status loadPlyMesh(const std::string& path, const glm::vec3& default_albedo, Mesh& mesh);
Status loadObjMesh(const std::string& path, const glm::vec3& default_albedo, Mesh& mesh,
                   Progress& progress);

// A square on the ground below everything else.
struct GroundPlane {
  bool enabled = false;
  int up_axis = 1;  // 0, 1, 2: x, y, z
  float size = 2;   // edge length over the diagonal of the bounds
  glm::vec3 albedo{0.5f};
};

// Appends the ground: centred below the bounds, lowered by 1/10000 of their diagonal so that flat
// bottoms do not share its plane.
void addGroundPlane(const GroundPlane& ground, Mesh& mesh);

}  // namespace surfeit
