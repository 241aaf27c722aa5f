// Triangle meshes from PLY: vertices x y z [nx ny nz] [red green blue], faces vertex_indices.

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>

#include "io/ply_reader.h"
#include "sample/mesh.h"

namespace surfeit {
namespace {

using Triple = std::array<const PlyProperty*, 3>;

// Three scalar properties of the element, or nothing unless all are there.
std::optional<Triple> findTriple(const PlyElement& element, std::string_view a, std::string_view b,
                                 std::string_view c) {
  const Triple triple = {element.find(a), element.find(b), element.find(c)};
  for (const PlyProperty* property : triple) {
    if (property == nullptr || property->is_list) return std::nullopt;
  }
  return triple;
}

glm::vec3 value(const std::byte* row, const Triple& triple) {
  glm::vec3 result;
  for (int i = 0; i < 3; ++i) {
    const PlyProperty& property = *triple[std::size_t(i)];
    result[i] = float(plyValue(row + property.offset, property.type));
  }
  return result;
}

// Bytes hold sRGB, floats are linear already (docs/format.md).
glm::vec3 linearColor(const std::byte* row, const Triple& triple) {
  const glm::vec3 color = value(row, triple);
  if (triple[0]->type != PlyType::kUint8) return glm::max(color, glm::vec3(0));
  return {linearFromSrgb8(std::uint8_t(color.x)), linearFromSrgb8(std::uint8_t(color.y)),
          linearFromSrgb8(std::uint8_t(color.z))};
}

Status readVertices(PlyReader& reader, const PlyElement& element, Mesh& mesh) {
  const std::optional<Triple> position = findTriple(element, "x", "y", "z");
  if (!position) {
    return Status::corruption(
        fmt::format("{}: element vertex: no properties x y z", reader.path()));
  }
  const std::optional<Triple> normal = findTriple(element, "nx", "ny", "nz");
  const std::optional<Triple> color = findTriple(element, "red", "green", "blue");
  const std::size_t vertex_begin = mesh.position.size();
  if (element.count >= std::numeric_limits<std::uint32_t>::max() - vertex_begin) {
    return Status::failed(
        fmt::format("{}: {} vertices, expected fewer than 2^32", reader.path(), element.count));
  }
  if (normal) mesh.normal.resize(vertex_begin, glm::vec3(0));
  if (color) mesh.color.resize(vertex_begin, glm::vec3(1));

  constexpr std::size_t kBatchRows = 4096;
  std::vector<std::byte> rows(kBatchRows * element.row_bytes);
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, reader.readRows(rows));
    if (count == 0) return {};
    for (std::size_t i = 0; i < count; ++i) {
      const std::byte* const row = &rows[i * element.row_bytes];
      mesh.position.push_back(value(row, *position));
      if (normal) mesh.normal.push_back(value(row, *normal));
      if (color) mesh.color.push_back(linearColor(row, *color));
    }
  }
}

Status readFaces(PlyReader& reader, const PlyElement& element, std::uint32_t material,
                 std::uint64_t vertex_begin, Mesh& mesh) {
  std::optional<std::size_t> list_property;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
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
                                              mesh.position.size() - vertex_begin - 1));
      }
      corners.push_back(vertex_begin + std::uint64_t(index));
    }
    SURFEIT_RETURN_IF_ERROR(addFace(corners, material, vertex_begin, reader.path(), face, mesh));
  }
}

}  // namespace

Status loadPlyMesh(const std::string& path, const glm::vec3& default_albedo, Mesh& mesh) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  const std::optional<std::size_t> vertex = reader.header().findElement("vertex");
  const std::optional<std::size_t> face = reader.header().findElement("face");
  if (!vertex || !face) {
    return Status::corruption(
        fmt::format("{}: no element {}: expected a triangle mesh (clouds need no sampling)", path,
                    vertex ? "face" : "vertex"));
  }

  const std::uint64_t vertex_begin = mesh.position.size();
  const PlyElement& vertex_element = reader.header().elements[*vertex];
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(*vertex));
  SURFEIT_RETURN_IF_ERROR(readVertices(reader, vertex_element, mesh));

  // Vertex colors are the albedo; only without them the default steps in
  Material material;
  const bool has_colors = findTriple(vertex_element, "red", "green", "blue").has_value();
  material.albedo = has_colors ? glm::vec3(1) : default_albedo;
  mesh.materials.push_back(material);
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(*face));
  return readFaces(reader, reader.header().elements[*face],
                   std::uint32_t(mesh.materials.size() - 1), vertex_begin, mesh);
}

}  // namespace surfeit
