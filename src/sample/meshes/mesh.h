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
#include "sample/meshes/texture.h"
#include "surfeit/progress.h"
#include "surfeit/sample.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr std::uint32_t kNoTexture = ~std::uint32_t{0};  // and no mask

// What photons find beside diffuse reflection (docs/photons.md, "Materials").
enum class Scattering : std::uint8_t { kMatte, kMirror, kGlass, kTranslucent };

struct Material {
  glm::vec3 albedo{0.5f};              // Kd: diffuse reflectance, scene-linear
  glm::vec3 emission{0};               // radiant exitance: pi times the radiance Ke
  std::uint32_t texture = kNoTexture;  // into Mesh::textures; multiplies the albedo
  std::uint32_t glow = kNoTexture;     // map_Ke, into Mesh::textures; multiplies the emission
  glm::vec3 opacity{1};                // d, filtered by Tf: 1 - (1 - d) Tf
  std::uint32_t mask = kNoTexture;     // map_d, into Mesh::masks: part of the surface that is there
  Scattering scattering = Scattering::kMatte;
  glm::vec3 specular{0};  // Ks of a mirror
  glm::vec3 transmission{
      1};              // Tf: of glass the color, of what is translucent the light let through
  float index = 1.5f;  // Ni of glass

  std::uint8_t group = 0;     // object group of its surfels
  bool is_two_sided = false;  // curves
  bool isOpaque() const { return opacity == glm::vec3(1) && mask == kNoTexture; }
};

// Triangles of one or several files. Vertex attributes are empty, or have one entry per position;
// a zero normal means "the triangle's own". Filled by the loaders, then immutable.
struct Mesh {
  // World units from `origin`; capacity for one more, so that Embree may read 16 bytes at the last
  // vertex
  std::vector<glm::vec3> position;
  glm::dvec3 origin{0};
  std::vector<glm::vec3> normal;  // shading normals, any length
  std::vector<glm::vec3> color;   // scene-linear; multiplies the albedo
  std::vector<glm::vec2> uv;
  std::vector<glm::uvec3> triangle;              // vertices; counter-clockwise seen from the front
  std::vector<std::uint32_t> triangle_material;  // one per triangle
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Mask> masks;
  std::vector<std::string> comments;     // of the files; of OBJ those in front
  std::uint64_t other_comments = 0;      // how many more there are
  std::vector<std::string> group_names;  // of the groups from 1, where they are asked for
  std::uint64_t degenerate_faces = 0;    // faces without area, skipped

  Bounds3 bounds() const;
  // Whether no material lets anything through.
  bool isOpaque() const;
  // Whether some material lets a part of the light through, everywhere alike.
  bool isTranslucent() const;
  // Whether some material lets colors through differently.
  bool hasTints() const;
  // Whether some material has two sides.
  bool hasTwoSides() const;
  // Gives vertices that came without an attribute that others have its neutral value, and Embree
  // the room that it reads into.
  void completeAttributes();
  // Bytes held by the arrays.
  std::uint64_t memoryBytes() const;
};

// A place on a mesh, ready for shading, counted from the mesh's origin. Both normals have unit
// length and agree on the front side: the geometric normal is turned to the side of the shading
// normal.
struct SurfacePoint {
  glm::vec3 position{0};
  glm::vec3 normal{0};
  glm::vec3 geometric_normal{0};
  glm::vec3 albedo{0};
  glm::vec3 emission{0};  // radiant exitance
  glm::vec3 opacity{1};
  float lift = 0;  // how much farther off the surface shadow rays start than rounding asks for
};

// The point of a triangle with barycentric weights (1 - u - v, u, v).
SurfacePoint surfacePoint(const Mesh& mesh, std::uint32_t triangle, float u, float v);

// The part of the surface that is there at that point for each color, from 0 to 1.
glm::vec3 opacityAt(const Mesh& mesh, std::uint32_t triangle, float u, float v);

// Mean exitance of a triangle: exact without a texture, else of a grid of places on it.
glm::vec3 meanEmission(const Mesh& mesh, std::uint32_t triangle);

// Area of a triangle, in double: sums over millions of triangles must stay exact.
double triangleArea(const Mesh& mesh, std::uint32_t triangle);

// Reads meshes one after the other into one. PLY, OBJ and hair are told apart by content and name.
// `default_albedo` is the reflectance of what has neither colors nor material. Notes tell of
// missing textures, and of faces that are skipped or cross themselves. kCorruption for files
// without any triangle.
Result<Mesh> loadMeshes(const std::vector<std::string>& paths, const glm::vec3& default_albedo,
                        Progress& progress, const CurveOptions& curves = {},
                        SampleGroups groups = SampleGroups::kNone);

// Appends the ground: centred below the bounds, lowered by 1/10000 of their diagonal so that flat
// bottoms do not share its plane.
void addGroundPlane(const GroundPlane& ground, Mesh& mesh);

}  // namespace surfeit
