// What a mesh takes in the end, ready for tracing, over what its readers hold of it
// (docs/architecture.md, "Memory").
inline constexpr double kHeldTimes = 2.5, kHeldTimesOfObj = 2.1;

// A mesh in the making: what the readers of mesh files add to.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sample/meshes/mesh.h"

namespace surfeit {

// Keeps places as doubles until all files are read and their origin can be chosen.
struct MeshBuilder {
  Mesh mesh;  // but for its positions and origin
  std::vector<glm::dvec3> position;
  std::uint64_t crossing_faces = 0;  // whose edges cross
  SampleGroups groups = SampleGroups::kNone;

  // The group of that name, which is made when it is new: one that cannot be a name of a group is
  // changed. kInvalidArgument, naming `path`, for more names than there are groups.
  Result<std::uint8_t> groupOf(std::string_view name, const std::string& path);

  // Appends the face with those corners (indices into position), polygons in triangles. Faces
  // without area are counted and skipped. kCorruption, naming the file and `face` (from 0), when a
  // corner is no vertex or is not finite.
  Status addFace(std::span<const std::uint64_t> corners, std::uint32_t material,
                 std::uint64_t vertex_begin, const std::string& path, std::uint64_t face);

  // The mesh, its places counted from the origin that serves all of them (originFor). Triangles
  // that have no area as floats are counted among the faces without.
  Mesh finish();

 private:
  std::vector<glm::dvec3> places_;     // of one face
  std::vector<glm::uvec3> triangles_;  // of one face
};

// The readers behind loadMeshes. They append, and leave attributes that the file lacks as they
// were.
Status loadPlyMesh(const std::string& path, const glm::vec3& default_albedo, MeshBuilder& builder,
                   Progress& progress);
Status loadObjMesh(const std::string& path, const glm::vec3& default_albedo,
                   const CurveOptions& curves, MeshBuilder& builder, Progress& progress);
Status loadHairMesh(const std::string& path, const CurveOptions& options, MeshBuilder& builder,
                    Progress& progress);
// The curves of a .bgeo file. `default_albedo` is of points without color.
Status loadHoudiniMesh(const std::string& path, const glm::vec3& default_albedo,
                       const CurveOptions& options, MeshBuilder& builder, Progress& progress);

}  // namespace surfeit
