// Triangle meshes from Wavefront OBJ and MTL, parsed by tinyobjloader. Nothing that the parser
// returns is trusted: every index is checked here.

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <istream>
#include <map>
#include <new>
#include <set>
#include <span>
#include <unordered_map>

#define TINYOBJLOADER_IMPLEMENTATION
#include "sample/meshes/curves.h"
#include "sample/meshes/mesh_builder.h"
#include "sample/meshes/obj_lines.h"
#include "sample/meshes/obj_material_files.h"
#include "sample/meshes/obj_materials.h"
#include "storage/file.h"

namespace surfeit {
namespace {

// What tinyobjloader makes of a file.
struct ParsedObj {
  tinyobj::attrib_t attributes;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  ObjVertexColors colors;
  std::map<std::string, MaterialSource> sources;
  std::string warnings;
  std::vector<std::string> notes;  // of material files
  std::uint64_t free_form_statements = 0, other_comments = 0;
  std::vector<std::string> comments;
};

// What the parser says, in words that say what to do.
std::string describeErrors(std::string errors) {
  while (!errors.empty() && errors.back() == '\n') errors.pop_back();
  const std::size_t line = errors.rfind("line ");
  if (errors.find("zero value for face index") == errors.npos || line == errors.npos) return errors;
  const std::string number =
      errors.substr(line + 5, errors.find_first_not_of("0123456789", line + 5) - line - 5);
  return fmt::format(
      "line {}: found index 0, expected 1 or more, for OBJ counts from 1: add 1 to all indices",
      number);
}

// `libraries`: statements that name material files, in front of all others.
Status parseObj(const std::string& path, ParsedObj& parsed, const std::string& libraries = {}) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  ObjLines lines(std::move(input), libraries);
  std::istream stream(&lines);
  MaterialFiles material_files(directoryOf(path));
  std::string errors;
  bool ok = false;
  try {
    // Polygons stay whole, and colors come from the lines: we want to see what the file says
    ok = tinyobj::LoadObj(&parsed.attributes, &parsed.shapes, &parsed.materials, &parsed.warnings,
                          &errors, &stream, &material_files, false, false);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& exception) {
    errors = exception.what();
  }
  SURFEIT_RETURN_IF_ERROR(lines.status());
  SURFEIT_RETURN_IF_ERROR(material_files.status());
  if (libraries.empty() && !lines.lateLibraries().empty()) {
    // The parser knows materials only behind the file that has them
    parsed = {};
    return parseObj(path, parsed, lines.lateLibraries());
  }
  parsed.free_form_statements = lines.freeFormStatements();
  parsed.comments = lines.comments();
  parsed.other_comments = lines.otherComments();
  parsed.colors = lines.takeColors();
  parsed.sources = material_files.sources();
  parsed.notes = material_files.notes();
  if (ok) return {};
  return Status::corruption(fmt::format("{}: {}", path, describeErrors(std::move(errors))));
}

// What the parser warns of, in one line.
void noteWarnings(const std::string& path, const std::string& warnings, Progress& progress) {
  const std::vector<std::string> lines = splitAt(shown(warnings), '\n');
  if (lines.empty()) return;
  const std::set<std::string> others(lines.begin() + 1, lines.end());
  const std::size_t more = others.size() - others.count(lines.front());
  progress.note(fmt::format("{}: {}{}", path, lines.front(),
                            more > 0 ? fmt::format(" (and {} more)", more) : ""));
}

// What a file has that is no face, nor a line that becomes a ribbon.
void noteLeftOut(const std::string& path, const ParsedObj& parsed, bool has_curves,
                 Progress& progress) {
  std::uint64_t corners = 0, lines = 0;
  for (const tinyobj::shape_t& shape : parsed.shapes) {
    corners += shape.points.indices.size();
    if (!has_curves) lines += shape.lines.indices.size();
  }
  if (corners + lines > 0) {
    progress.note(
        fmt::format("{}: lines and points of {} corners are left out: they have no area{}", path,
                    corners + lines, lines > 0 ? " (--curve-width gives lines one)" : ""));
  }
  if (parsed.free_form_statements > 0) {
    progress.note(fmt::format(
        "{}: {} free-form curves and surfaces are left out: export the mesh tessellated", path,
        parsed.free_form_statements));
  }
}

// An OBJ corner: indices of position, normal and texture coordinate, -1 where absent.
struct Corner {
  int vertex, normal, uv;
  bool operator==(const Corner&) const = default;
};

struct CornerHash {
  std::size_t operator()(const Corner& corner) const {
    std::uint64_t hash = std::uint32_t(corner.vertex);
    hash = hash * 0x9e3779b97f4a7c15u + std::uint32_t(corner.normal);
    hash = hash * 0x9e3779b97f4a7c15u + std::uint32_t(corner.uv);
    return std::size_t(hash ^ (hash >> 29));
  }
};

// Of faces without a material. Colors of vertices are the albedo; only without them the default
// steps in.
Material plainMaterial(const ParsedObj& parsed, const glm::vec3& default_albedo) {
  Material plain;
  plain.albedo = parsed.colors.empty() ? default_albedo : glm::vec3(1);
  return plain;
}

// Turns parsed shapes into triangles of one mesh.
class ObjImporter {
 public:
  ObjImporter(const std::string& path, const ParsedObj& parsed, const glm::vec3& default_albedo,
              MeshBuilder& builder, Progress& progress)
      : path_(path),
        parsed_(parsed),
        builder_(builder),
        mesh_(builder.mesh),
        progress_(progress),
        materials_(path, parsed.materials, parsed.sources, plainMaterial(parsed, default_albedo),
                   builder.mesh, progress) {
    has_normals_ = !parsed.attributes.normals.empty();
    has_uvs_ = !parsed.attributes.texcoords.empty();
    has_colors_ = !parsed.colors.empty();
    vertex_begin_ = builder.position.size();
    if (has_normals_) mesh_.normal.resize(vertex_begin_, glm::vec3(0));
    if (has_uvs_) mesh_.uv.resize(vertex_begin_, glm::vec2(0));
    if (has_colors_) mesh_.color.resize(vertex_begin_, glm::vec3(1));
  }

  Status importFaces() {
    std::vector<std::uint64_t> corners;
    std::uint64_t face = 0;
    for (const tinyobj::shape_t& shape : parsed_.shapes) {
      const tinyobj::mesh_t& faces = shape.mesh;
      std::size_t index = 0;
      for (std::size_t i = 0; i < faces.num_face_vertices.size(); ++i, ++face) {
        const std::size_t count = faces.num_face_vertices[i];
        if (count > faces.indices.size() - index) return tooManyCorners();
        corners.clear();
        bool has_uv = true;
        for (const std::size_t end = index + count; index < end; ++index) {
          SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t corner,
                                   importCorner(faces.indices[index], face));
          corners.push_back(corner);
          has_uv = has_uv && faces.indices[index].texcoord_index >= 0;
        }
        const int id = i < faces.material_ids.size() ? faces.material_ids[i] : -1;
        SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t material, materialOf(shape.name, id, has_uv));
        SURFEIT_RETURN_IF_ERROR(builder_.addFace(corners, material, vertex_begin_, path_, face));
      }
      if (index != faces.indices.size()) return tooManyCorners();
    }
    materials_.noteFacesWithoutUv();
    noteUnusedMaterials();
    return {};
  }

  // Lines as ribbons, of the color that vertices have.
  Status importLines(const CurveOptions& options) {
    std::uint64_t count = 0, strand = 0;
    for (const tinyobj::shape_t& shape : parsed_.shapes) {
      count += shape.lines.num_line_vertices.size();
    }
    if (count == 0) return {};
    const StrandChoice choice(count, options.strands);
    double area = 0, kept_area = 0;
    const auto measure = [&](std::span<const CurvePoint> points) -> Status {
      const double own = curveArea(points);
      area += own;
      if (choice.keeps(strand++)) kept_area += own;
      return {};
    };
    SURFEIT_RETURN_IF_ERROR(forEachLine(options, measure));
    Material material = mesh_.materials[materials_.plain()];
    material.is_two_sided = true;
    if (builder_.groups == SampleGroups::kObject || builder_.groups == SampleGroups::kMaterial) {
      progress_.note(fmt::format(
          "{}: lines are in group 0: groups by object or material are of faces", path_));
    }
    mesh_.materials.push_back(material);
    CurveRibbons ribbons(builder_, std::uint32_t(mesh_.materials.size() - 1), has_colors_, path_);
    const double growth = kept_area > 0 ? area / kept_area : 1;
    strand = 0;
    const auto add = [&](std::span<const CurvePoint> points) -> Status {
      const std::uint64_t number = strand++;
      if (!choice.keeps(number)) return {};
      SURFEIT_RETURN_IF_ERROR(ribbons.add(points, number, growth));
      completeVertices();
      return {};
    };
    SURFEIT_RETURN_IF_ERROR(forEachLine(options, add));
    if (ribbons.pointlike() > 0) {
      progress_.note(
          fmt::format("{}: {} lines without length skipped", path_, ribbons.pointlike()));
    }
    return {};
  }

 private:
  // Names that are not there are told by the parser.
  void noteUnusedMaterials() const {
    if (has_material_ || parsed_.materials.empty() || !parsed_.warnings.empty()) return;
    progress_.note(
        fmt::format("{}: no face uses any of the {} materials (\"{}\", ...): usemtl in front of "
                    "the faces names "
                    "the one that they have",
                    path_, parsed_.materials.size(), shown(parsed_.materials.front().name)));
  }

  // The material of a face with that id. Groups by object have copies of materials, one for each
  // object that they are on.
  Result<std::uint32_t> materialOf(const std::string& object, int id, bool has_uv) {
    const std::uint32_t material = materials_.ofFace(id, has_uv);
    has_material_ = has_material_ || materials_.has(id);
    const bool is_by_material = builder_.groups == SampleGroups::kMaterial;
    if (!is_by_material && builder_.groups != SampleGroups::kObject) return material;
    std::string name = object;
    if (is_by_material) name = materials_.has(id) ? parsed_.materials[std::size_t(id)].name : "";
    std::replace(name.begin(), name.end(), kNameBlank, ' ');
    if (name.empty()) return material;

    SURFEIT_ASSIGN_OR_RETURN(const std::uint8_t group, builder_.groupOf(name, path_));
    const auto [copy, is_new] = grouped_.try_emplace({material, group}, 0);
    if (is_new) {
      copy->second = std::uint32_t(mesh_.materials.size());
      Material grouped = mesh_.materials[material];
      grouped.group = group;
      mesh_.materials.push_back(grouped);
    }
    return copy->second;
  }

  template <typename Visit>
  Status forEachLine(const CurveOptions& options, Visit&& visit) const {
    std::vector<CurvePoint> points;
    const std::size_t vertices = parsed_.attributes.vertices.size() / 3;
    std::uint64_t line = 0;
    for (const tinyobj::shape_t& shape : parsed_.shapes) {
      std::size_t index = 0;
      for (const int corners : shape.lines.num_line_vertices) {
        points.clear();
        for (int k = 0; k < corners && index < shape.lines.indices.size(); ++k, ++index) {
          const int vertex = shape.lines.indices[index].vertex_index;
          if (vertex < 0 || std::size_t(vertex) >= vertices) {
            return Status::corruption(fmt::format("{}: line {}: vertex {}, expected 1 to {}", path_,
                                                  line, vertex + 1, vertices));
          }
          const double* const at = &parsed_.attributes.vertices[3 * std::size_t(vertex)];
          points.push_back(
              {{at[0], at[1], at[2]},
               options.width,
               has_colors_ ? parsed_.colors.linear(std::size_t(vertex)) : glm::vec3(1)});
        }
        ++line;
        SURFEIT_RETURN_IF_ERROR(visit(std::span<const CurvePoint>(points)));
      }
    }
    return {};
  }

  // Gives the corners of ribbons, which have none, neutral normals and texture coordinates.
  void completeVertices() {
    if (has_normals_) mesh_.normal.resize(builder_.position.size(), glm::vec3(0));
    if (has_uvs_) mesh_.uv.resize(builder_.position.size(), glm::vec2(0));
  }

  // The parser counts the corners of a face in 8 bits.
  Status tooManyCorners() const {
    return Status::corruption(fmt::format("{}: a face has more than 255 corners", path_));
  }

  // The mesh vertex for an OBJ corner, made on first use.
  Result<std::uint64_t> importCorner(const tinyobj::index_t& index, std::uint64_t face) {
    const tinyobj::attrib_t& attributes = parsed_.attributes;
    const Corner corner{index.vertex_index, index.normal_index, index.texcoord_index};
    const auto isOutside = [](int i, std::size_t values, std::size_t per_item, int least) {
      return i < least || (i >= 0 && std::size_t(i) >= values / per_item);
    };
    const std::size_t vertices = attributes.vertices.size() / 3;
    if (isOutside(corner.vertex, attributes.vertices.size(), 3, 0)) {
      return Status::corruption(fmt::format("{}: face {}: vertex {}, expected 1 to {}", path_, face,
                                            corner.vertex + 1, vertices));
    }
    if (isOutside(corner.normal, attributes.normals.size(), 3, -1) ||
        isOutside(corner.uv, attributes.texcoords.size(), 2, -1)) {
      return Status::corruption(
          fmt::format("{}: face {}: normal or texture coordinate out of range", path_, face));
    }

    const auto [found, is_new] = vertices_.try_emplace(corner, builder_.position.size());
    if (!is_new) return found->second;
    const auto vector = [](const std::vector<double>& values, int i) {
      const double* const value = &values[3 * std::size_t(i)];
      return glm::dvec3(value[0], value[1], value[2]);
    };
    builder_.position.push_back(vector(attributes.vertices, corner.vertex));
    if (has_normals_) {
      mesh_.normal.emplace_back(corner.normal >= 0 ? vector(attributes.normals, corner.normal)
                                                   : glm::dvec3(0));
    }
    if (has_uvs_) {
      const std::size_t i = 2 * std::size_t(corner.uv);
      mesh_.uv.push_back(corner.uv >= 0
                             ? glm::vec2(attributes.texcoords[i], attributes.texcoords[i + 1])
                             : glm::vec2(0));
    }
    if (has_colors_) mesh_.color.push_back(parsed_.colors.linear(std::size_t(corner.vertex)));
    return found->second;
  }

  const std::string& path_;
  const ParsedObj& parsed_;
  MeshBuilder& builder_;
  Mesh& mesh_;
  Progress& progress_;
  bool has_normals_, has_uvs_, has_colors_;
  bool has_material_ = false;  // any face
  std::uint64_t vertex_begin_;
  ObjMaterials materials_;
  std::map<std::pair<std::uint32_t, std::uint8_t>, std::uint32_t> grouped_;  // copies of materials
  std::unordered_map<Corner, std::uint64_t, CornerHash> vertices_;
};

}  // namespace

Status loadObjMesh(const std::string& path, const glm::vec3& default_albedo,
                   const CurveOptions& curves, MeshBuilder& builder, Progress& progress) {
  ParsedObj parsed;
  SURFEIT_RETURN_IF_ERROR(parseObj(path, parsed));
  noteWarnings(path, parsed.warnings, progress);
  for (const std::string& note : parsed.notes) progress.note(note);
  for (const std::string& note : parsed.colors.notes()) progress.note(path + ": " + note);
  noteLeftOut(path, parsed, curves.width > 0, progress);
  builder.mesh.comments.insert(builder.mesh.comments.end(), parsed.comments.begin(),
                               parsed.comments.end());
  builder.mesh.other_comments += parsed.other_comments;
  ObjImporter importer(path, parsed, default_albedo, builder, progress);
  SURFEIT_RETURN_IF_ERROR(importer.importFaces());
  if (curves.width > 0) return importer.importLines(curves);
  return {};
}

}  // namespace surfeit
