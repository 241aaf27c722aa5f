// Triangle meshes from PLY: vertices x y z [nx ny nz] [red green blue], faces vertex_indices.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>

#include "cloud/cloud_formats.h"
#include "cloud/ply/ply_reader.h"
#include "cloud/rows/srgb_curve.h"
#include "core/resident_limit.h"
#include "sample/meshes/mesh_builder.h"

namespace surfeit {
namespace {

// Faces after which memory is looked at.
constexpr std::uint64_t kCheckedFaces = 65536;

using Triple = std::array<const RowProperty*, 3>;

// Three scalar properties of the element, or nothing unless all are there.
std::optional<Triple> findTriple(const RowLayout& element, std::string_view a, std::string_view b,
                                 std::string_view c) {
  const Triple triple = {element.find(a), element.find(b), element.find(c)};
  for (const RowProperty* property : triple) {
    if (property == nullptr || property->is_list) return std::nullopt;
  }
  return triple;
}

glm::dvec3 value(const std::byte* row, const Triple& triple) {
  glm::dvec3 result;
  for (int i = 0; i < 3; ++i) {
    const RowProperty& property = *triple[std::size_t(i)];
    result[i] = rowValue(row + property.offset, property.type);
  }
  return result;
}

// Integers code sRGB, floats are linear already (docs/format.md).
glm::vec3 linearColor(const std::byte* row, const Triple& triple) {
  glm::vec3 color = glm::max(glm::vec3(value(row, triple)), glm::vec3(0));
  for (int i = 0; i < 3; ++i) {
    const ValueType type = triple[std::size_t(i)]->type;
    if (!codesSrgb(type)) continue;
    color[i] = type == ValueType::kUint8 ? linearFromSrgb8(std::uint8_t(color[i]))
                                         : linearFromSrgb(color[i] / 65535);
  }
  return color;
}

// Vertices are rows like those of clouds, so that names and colors are read as there.
Result<std::unique_ptr<RowReader>> openVertices(const std::string& path, Progress& progress) {
  RowReaderOptions options;
  options.part = "vertex";
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> rows, openRowReader(path, options));
  // What rows do not have is read here
  const std::vector<std::string> of_file = rows->file().notes();
  for (const std::string& note : rows->notes()) {
    if (std::find(of_file.begin(), of_file.end(), note) == of_file.end()) {
      progress.note(path + ": " + note);
    }
  }
  return rows;
}

// Returns whether vertices have colors.
Result<bool> readVertices(RowReader& reader, MeshBuilder& builder) {
  const RowLayout& element = reader.element();
  const std::optional<Triple> position = findTriple(element, "x", "y", "z");
  if (!position) {
    return Status::corruption(
        fmt::format("{}: element vertex: no properties x y z", reader.path()));
  }
  const std::optional<Triple> normal = findTriple(element, "nx", "ny", "nz");
  const std::optional<Triple> color = findTriple(element, "red", "green", "blue");
  Mesh& mesh = builder.mesh;
  const std::size_t vertex_begin = builder.position.size();
  if (element.count >= std::numeric_limits<std::uint32_t>::max() - vertex_begin) {
    return Status::failed(
        fmt::format("{}: {} vertices, expected fewer than 2^32", reader.path(), element.count));
  }
  if (normal) mesh.normal.resize(vertex_begin, glm::vec3(0));
  if (color) mesh.color.resize(vertex_begin, glm::vec3(1));

  constexpr std::size_t kBatchRows = 4096;
  AlignedBuffer buffer;
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRows(kBatchRows, buffer));
    if (rows.empty()) return color.has_value();
    const double part = double(builder.position.size() - vertex_begin) / double(element.count) / 3;
    SURFEIT_RETURN_IF_ERROR(checkResidentBytes(reader.path(), 0, part, kHeldTimes));
    for (std::size_t at = 0; at < rows.size(); at += element.row_bytes) {
      const std::byte* const row = &rows[at];
      builder.position.push_back(value(row, *position));
      if (normal) mesh.normal.emplace_back(value(row, *normal));
      if (color) mesh.color.push_back(linearColor(row, *color));
    }
  }
}

Status readFaces(PlyReader& reader, const RowLayout& element, std::uint32_t material,
                 std::uint64_t vertex_begin, MeshBuilder& builder) {
  std::optional<std::size_t> list_property;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const RowProperty& property = element.properties[i];
    if (property.is_list &&
        (property.name == "vertex_indices" || property.name == "vertex_index")) {
      list_property = i;
    }
  }
  if (!list_property) {
    return Status::corruption(
        fmt::format("{}: element face: no list property vertex_indices", reader.path()));
  }

  std::vector<std::byte> scalars(element.row_bytes);
  std::vector<double> list;
  std::vector<std::uint64_t> corners;
  for (std::uint64_t face = 0;; ++face) {
    SURFEIT_ASSIGN_OR_RETURN(const bool found,
                             reader.readRowWithList(scalars, *list_property, list));
    if (!found) return {};
    corners.clear();
    for (const double index : list) {
      // Written so that NaN fails; 2^53 is far above any vertex count
      if (!(index >= 0 && index < 9007199254740992.0)) {
        return Status::corruption(fmt::format("{}: face {}: vertex {}, expected 0 to {}",
                                              reader.path(), face, index,
                                              builder.position.size() - vertex_begin - 1));
      }
      corners.push_back(vertex_begin + std::uint64_t(index));
    }
    SURFEIT_RETURN_IF_ERROR(builder.addFace(corners, material, vertex_begin, reader.path(), face));
    if (face % kCheckedFaces == 0) {
      // Vertices are some half of what faces are
      const double part = (1 + 2 * double(face) / double(element.count)) / 3;
      SURFEIT_RETURN_IF_ERROR(checkResidentBytes(reader.path(), 0, part, kHeldTimes));
    }
  }
}

}  // namespace

Status loadPlyMesh(const std::string& path, const glm::vec3& default_albedo, MeshBuilder& builder,
                   Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  const std::optional<std::size_t> face = reader.header().findElement("face");
  if (!face || !reader.header().findElement("vertex")) {
    const bool has_strips = reader.header().findElement("tristrips").has_value();
    return Status::corruption(fmt::format(
        "{}: no element {}: expected a triangle mesh ({})", path, face ? "vertex" : "face",
        has_strips ? "triangle strips are not read: write faces" : "clouds need no sampling"));
  }
  for (const std::string& comment : reader.header().comments) {
    builder.mesh.comments.push_back(comment);
    if (!comment.starts_with("TextureFile")) continue;
    progress.note(
        fmt::format("{}: {}: textures of PLY are not read (those of OBJ are)", path, comment));
  }

  const RowLayout& faces = reader.header().elements[*face];
  if (findTriple(faces, "red", "green", "blue")) {
    progress.note(path + ": colors of faces are not read, those of vertices are: transfer them");
  }

  const std::uint64_t vertex_begin = builder.position.size();
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> rows, openVertices(path, progress));
  SURFEIT_ASSIGN_OR_RETURN(const bool has_colors, readVertices(*rows, builder));

  // Vertex colors are the albedo; only without them the default steps in
  Material material;
  material.albedo = has_colors ? glm::vec3(1) : default_albedo;
  builder.mesh.materials.push_back(material);
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(*face));
  return readFaces(reader, faces, std::uint32_t(builder.mesh.materials.size() - 1), vertex_begin,
                   builder);
}

}  // namespace surfeit
