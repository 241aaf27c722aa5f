#include "sample/meshes/mesh_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <new>
#include <string_view>
#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/houdini/bgeo_json_cursor.h"
#include "core/surfel_limits.h"
#include "core/text_case.h"
#include "sample/meshes/polygon.h"
#include "storage/byte_output.h"
#include "storage/file.h"
#include "surfeit/surfel.h"

namespace surfeit {
namespace {

bool isFinite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Tells when floats hold vertices worse than to a thousandth of the size of triangles.
void noteFarVertices(const std::string& path, const Mesh& mesh, Progress& progress) {
  const Bounds3 bounds = mesh.bounds();
  const double size = double(bounds.longestSide()) / std::sqrt(double(mesh.triangle.size()));
  const double step = floatStep(movedBounds(bounds, glm::dvec3(0)));
  if (step <= 1e-3 * size) return;
  progress.note(fmt::format(
      "{}: vertices are taken as floats, which stand {:.2g} apart in a scene so wide, beside "
      "triangles of about {:.2g}: sample the parts one by one",
      path, step, size));
}

// Names of groups have no commas, control characters or digits at the front (checkGroupName).
std::string usableGroupName(std::string_view name) {
  constexpr std::size_t kLongest = 200;
  std::string usable(name.substr(0, kLongest - 1));
  for (char& c : usable) {
    if (c == ',' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '_';
  }
  if (!usable.empty() && usable[0] >= '0' && usable[0] <= '9') usable.insert(usable.begin(), '_');
  return usable;
}

// Gives what a file without groups of its own has one.
Status groupByFile(const std::string& path, std::size_t first_material, MeshBuilder& builder) {
  const std::string stem = std::filesystem::path(path).stem().string();
  SURFEIT_ASSIGN_OR_RETURN(const std::uint8_t group, builder.groupOf(stem, path));
  std::vector<Material>& materials = builder.mesh.materials;
  for (std::size_t i = first_material; i < materials.size(); ++i) materials[i].group = group;
  return {};
}

enum class MeshFormat { kPly, kObj, kHair, kHoudini, kUnknown };

// PLY, hair and Houdini's curves by their magic. OBJ has none, nor other files of Houdini, which
// are refused with the way out: there the name tells.
Result<MeshFormat> recogniseMesh(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  char magic[8] = {};
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           file.readSome(0, std::as_writable_bytes(std::span(magic))));
  const std::string_view begin(magic, count);
  if (begin.starts_with("ply")) return MeshFormat::kPly;
  if (begin.starts_with("HAIR")) return MeshFormat::kHair;
  if (startsBinaryJson(begin)) return MeshFormat::kHoudini;
  const std::string_view name = withoutCompression(path);
  for (const char* const extension : {".bgeo", ".geo", ".bgeo.sc"}) {
    if (hasEnding(name, extension)) return MeshFormat::kHoudini;
  }
  if (hasEnding(path, ".obj")) return MeshFormat::kObj;
  return MeshFormat::kUnknown;
}

Status unknownMesh(const std::string& path) {
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  char first[64] = {};
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t count,
                           file.readSome(0, std::as_writable_bytes(std::span(first))));
  const std::string other = nameOfOtherFormat(path, {first, count});
  return Status::corruption(fmt::format(
      "{}: found {}, expected PLY, OBJ (by its name), hair or curves of Houdini (.bgeo): save the "
      "mesh as OBJ or PLY, for example with Blender or MeshLab",
      path, other.empty() ? "no mesh that we read" : other));
}

Status loadFile(const std::string& path, const glm::vec3& default_albedo,
                const CurveOptions& curves, MeshBuilder& builder, Progress& progress) {
  const std::size_t triangles_before = builder.mesh.triangle.size();
  const std::uint64_t degenerate_before = builder.mesh.degenerate_faces;
  const std::uint64_t crossing_before = builder.crossing_faces;
  const std::size_t materials_before = builder.mesh.materials.size();
  SURFEIT_ASSIGN_OR_RETURN(const MeshFormat format, recogniseMesh(path));
  switch (format) {
    case MeshFormat::kPly:
      SURFEIT_RETURN_IF_ERROR(loadPlyMesh(path, default_albedo, builder, progress));
      break;
    case MeshFormat::kObj:
      SURFEIT_RETURN_IF_ERROR(loadObjMesh(path, default_albedo, curves, builder, progress));
      break;
    case MeshFormat::kHair:
      SURFEIT_RETURN_IF_ERROR(loadHairMesh(path, curves, builder, progress));
      break;
    case MeshFormat::kHoudini:
      SURFEIT_RETURN_IF_ERROR(loadHoudiniMesh(path, default_albedo, curves, builder, progress));
      break;
    case MeshFormat::kUnknown:
      return unknownMesh(path);
  }
  const bool has_own_groups = format == MeshFormat::kObj && builder.groups != SampleGroups::kFile;
  if (builder.groups != SampleGroups::kNone && !has_own_groups) {
    SURFEIT_RETURN_IF_ERROR(groupByFile(path, materials_before, builder));
  }
  const std::uint64_t degenerate = builder.mesh.degenerate_faces - degenerate_before;
  if (builder.mesh.triangle.size() == triangles_before) {
    return Status::corruption(fmt::format(
        "{}: no triangles ({} faces without area){}", path, degenerate,
        degenerate > 0 ? "" : ": points alone are a cloud: save them as PLY or text for index"));
  }
  if (degenerate > 0) {
    progress.note(fmt::format("{}: {} faces without area skipped", path, degenerate));
  }
  if (const std::uint64_t crossing = builder.crossing_faces - crossing_before; crossing > 0) {
    progress.note(fmt::format(
        "{}: the edges of {} faces cross: parts of them count twice or not at all (split them "
        "where they cross)",
        path, crossing));
  }
  return {};
}

}  // namespace

Status MeshBuilder::addFace(std::span<const std::uint64_t> corners, std::uint32_t material,
                            std::uint64_t vertex_begin, const std::string& path,
                            std::uint64_t face) {
  places_.clear();
  for (const std::uint64_t corner : corners) {
    if (corner < vertex_begin || corner >= position.size()) {
      return Status::corruption(fmt::format("{}: face {}: vertex {}, expected 0 to {}", path, face,
                                            std::int64_t(corner - vertex_begin),
                                            std::int64_t(position.size() - vertex_begin) - 1));
    }
    places_.push_back(position[corner]);
    if (const glm::dvec3 size = glm::abs(places_.back());
        std::max({size.x, size.y, size.z}) > double(kLargestLength) && isFinite(size)) {
      return Status::corruption(
          fmt::format("{}: face {}: vertex {} is at {:.3g} {:.3g} {:.3g}, expected at most {:g}: "
                      "surfels have no larger places",
                      path, face, corner - vertex_begin, places_.back().x, places_.back().y,
                      places_.back().z, kLargestLength));
    }
    if (!isFinite(places_.back())) {
      return Status::corruption(
          fmt::format("{}: face {}: vertex {} is not finite", path, face, corner - vertex_begin));
    }
  }
  if (mesh.triangle.size() + corners.size() >= std::numeric_limits<std::uint32_t>::max()) {
    return Status::failed(fmt::format("{}: face {}: more than 2^32 triangles", path, face));
  }

  triangles_.clear();
  if (!cutPolygon(places_, triangles_)) ++crossing_faces;
  bool has_area = false;
  for (const glm::uvec3& cut : triangles_) {
    const glm::dvec3& a = places_[cut.x];
    if (!(glm::length(glm::cross(places_[cut.y] - a, places_[cut.z] - a)) > 0)) continue;
    mesh.triangle.emplace_back(std::uint32_t(corners[cut.x]), std::uint32_t(corners[cut.y]),
                               std::uint32_t(corners[cut.z]));
    mesh.triangle_material.push_back(material);
    has_area = true;
  }
  if (!has_area) ++mesh.degenerate_faces;
  return {};
}

Result<std::uint8_t> MeshBuilder::groupOf(std::string_view name, const std::string& path) {
  std::vector<std::string>& names = mesh.group_names;
  const std::string usable = usableGroupName(name);
  const auto found = std::find(names.begin(), names.end(), usable);
  const auto group = static_cast<std::size_t>(found - names.begin()) + 1;
  if (found != names.end()) return static_cast<std::uint8_t>(group);
  if (group >= kMaxGroups) {
    return Status::invalidArgument(fmt::format(
        "{}: \"{}\" is name {} of a group, expected at most {}: group by file or material, or "
        "sample parts of the scene apart and name them (index --group)",
        path, usable, group, kMaxGroups - 1));
  }
  names.push_back(usable);
  return static_cast<std::uint8_t>(group);
}

Mesh MeshBuilder::finish() {
  Bounds3d bounds;
  for (const glm::uvec3& corners : mesh.triangle) {
    for (int i = 0; i < 3; ++i) bounds.add(position[corners[i]]);
  }
  mesh.origin = originFor(bounds);
  mesh.position.reserve(position.size() + 1);
  for (const glm::dvec3& place : position) mesh.position.emplace_back(place - mesh.origin);
  position = {};

  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    if (!(triangleArea(mesh, std::uint32_t(i)) > 0)) continue;
    mesh.triangle[kept] = mesh.triangle[i];
    mesh.triangle_material[kept] = mesh.triangle_material[i];
    ++kept;
  }
  mesh.degenerate_faces += mesh.triangle.size() - kept;
  mesh.triangle.resize(kept);
  mesh.triangle_material.resize(kept);
  mesh.completeAttributes();
  return std::move(mesh);
}

Result<Mesh> loadMeshes(const std::vector<std::string>& paths, const glm::vec3& default_albedo,
                        Progress& progress, const CurveOptions& curves, SampleGroups groups) {
  if (paths.empty()) return Status::invalidArgument("no mesh given");
  MeshBuilder builder;
  builder.groups = groups;
  try {
    for (const std::string& path : paths) {
      SURFEIT_RETURN_IF_ERROR(loadFile(path, default_albedo, curves, builder, progress));
    }
    const std::uint64_t degenerate = builder.mesh.degenerate_faces;
    Mesh mesh = builder.finish();
    noteFarVertices(paths.front(), mesh, progress);
    if (const std::uint64_t more = mesh.degenerate_faces - degenerate; more > 0) {
      progress.note(
          fmt::format("{}: {} triangles too small for floats skipped", paths.front(), more));
    }
    if (mesh.triangle.empty()) {
      return Status::corruption(
          fmt::format("{}: all triangles are too small for floats", paths.front()));
    }
    return mesh;
  } catch (const std::bad_alloc&) {
    return Status::failed(fmt::format("{}: out of memory after {} triangles", paths.front(),
                                      builder.mesh.triangle.size()));
  }
}

}  // namespace surfeit
