// Triangle meshes from Wavefront OBJ and MTL, parsed by tinyobjloader. Nothing that the parser
// returns is trusted: every index is checked here.

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <istream>
#include <map>
#include <new>
#include <set>
#include <unordered_map>

// The library's own build has floats, too few digits for places on a map
#define TINYOBJLOADER_USE_DOUBLE
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>

#include "core/spherical_harmonics.h"
#include "sample/mesh_builder.h"
#include "sample/obj_lines.h"
#include "storage/file.h"

namespace surfeit {
namespace {

// What tinyobjloader makes of a file.
struct ParsedObj {
  tinyobj::attrib_t attributes;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warnings;
  std::uint64_t free_form_statements = 0;
};

// The words of a line without line end, then of another one.
std::vector<std::string> splitAt(const std::string& text, char separator) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    if (end > begin) parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::string shown(std::string name) {
  std::replace(name.begin(), name.end(), kNameBlank, ' ');
  return name;
}

// Finds material files beside the OBJ file: a name with blanks may be that of one, or of several.
class MaterialFiles final : public tinyobj::MaterialReader {
 public:
  explicit MaterialFiles(std::string directory) : directory_(std::move(directory)) {}

  const Status& status() const { return status_; }

  bool operator()(const std::string& names, std::vector<tinyobj::material_t>* materials,
                  std::map<std::string, int>* ids, std::string* warnings,
                  std::string* errors) override {
    std::vector<std::string> found;
    if (const std::string whole = find(shown(names)); !whole.empty()) {
      found.push_back(whole);
    } else {
      std::string missing;
      for (const std::string& name : splitAt(names, kNameBlank)) {
        if (const std::string part = find(name); !part.empty()) {
          found.push_back(part);
        } else {
          missing += "material file \"" + name + "\" not found\n";
        }
      }
      if (found.empty()) missing = "material file \"" + shown(names) + "\" not found\n";
      *warnings += missing;
    }
    for (const std::string& path : found) load(path, materials, ids, warnings, errors);
    return true;  // else the parser adds words of its own
  }

 private:
  // Where the file is; empty: nowhere. Paths of another machine are left out.
  std::string find(const std::string& name) const {
    const std::filesystem::path directory(directory_), given(name);
    std::error_code ignored;
    for (const std::filesystem::path& path : {directory / given, directory / given.filename()}) {
      if (std::filesystem::is_regular_file(path, ignored)) return path.string();
    }
    return {};
  }

  void load(const std::string& path, std::vector<tinyobj::material_t>* materials,
            std::map<std::string, int>* ids, std::string* warnings, std::string* errors) {
    Result<ByteInput> input = ByteInput::open(path);
    if (!input.ok()) {
      status_ = input.status();
      return;
    }
    ObjLines lines(std::move(*input));
    std::istream stream(&lines);
    std::string warned, failed;  // it replaces what is there
    tinyobj::LoadMtl(ids, materials, &stream, &warned, &failed);
    *warnings += warned;
    *errors += failed;
    if (!lines.status().ok()) status_ = lines.status();
  }

  std::string directory_;
  Status status_;
};

Status parseObj(const std::string& path, ParsedObj& parsed) {
  SURFEIT_ASSIGN_OR_RETURN(ByteInput input, ByteInput::open(path));
  ObjLines lines(std::move(input));
  std::istream stream(&lines);
  MaterialFiles material_files(directoryOf(path));
  std::string errors;
  bool ok = false;
  try {
    // Polygons stay whole and colors are not made up: we want to see what the file says
    ok = tinyobj::LoadObj(&parsed.attributes, &parsed.shapes, &parsed.materials, &parsed.warnings,
                          &errors, &stream, &material_files, false, false);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& exception) {
    errors = exception.what();
  }
  SURFEIT_RETURN_IF_ERROR(lines.status());
  SURFEIT_RETURN_IF_ERROR(material_files.status());
  parsed.free_form_statements = lines.freeFormStatements();
  if (ok) return {};
  while (!errors.empty() && errors.back() == '\n') errors.pop_back();
  return Status::corruption(fmt::format("{}: {}", path, errors));
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

// What a file has that is no face.
void noteLeftOut(const std::string& path, const ParsedObj& parsed, Progress& progress) {
  std::uint64_t corners = 0;
  for (const tinyobj::shape_t& shape : parsed.shapes) {
    corners += shape.lines.indices.size() + shape.points.indices.size();
  }
  if (corners > 0) {
    progress.note(fmt::format("{}: lines and points of {} corners are left out: they have no area",
                              path, corners));
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

// Turns parsed shapes into triangles of one mesh.
class ObjImporter {
 public:
  ObjImporter(const std::string& path, const ParsedObj& parsed, const glm::vec3& default_albedo,
              MeshBuilder& builder, Progress& progress)
      : path_(path), parsed_(parsed), builder_(builder), mesh_(builder.mesh), progress_(progress) {
    has_normals_ = !parsed.attributes.normals.empty();
    has_uvs_ = !parsed.attributes.texcoords.empty();
    has_colors_ = !parsed.attributes.colors.empty();
    vertex_begin_ = builder.position.size();
    if (has_normals_) mesh_.normal.resize(vertex_begin_, glm::vec3(0));
    if (has_uvs_) mesh_.uv.resize(vertex_begin_, glm::vec2(0));
    if (has_colors_) {
      mesh_.color.resize(vertex_begin_, glm::vec3(1));
      findColorRange();
    }

    // Material ids of the file follow the one for faces without a material
    material_begin_ = std::uint32_t(mesh_.materials.size());
    Material plain;
    plain.albedo = has_colors_ ? glm::vec3(1) : default_albedo;
    mesh_.materials.push_back(plain);
  }

  void importMaterials() {
    for (const tinyobj::material_t& parsed : parsed_.materials) {
      Material material;
      material.albedo = {parsed.diffuse[0], parsed.diffuse[1], parsed.diffuse[2]};
      material.emission =
          kPi * glm::vec3(parsed.emission[0], parsed.emission[1], parsed.emission[2]);
      // Written so that NaN is opaque, and becomes 0 below
      material.opacity = parsed.dissolve < 1 ? float(std::max(parsed.dissolve, 0.0)) : 1;
      for (int i = 0; i < 3; ++i) {
        if (!(material.albedo[i] >= 0)) material.albedo[i] = 0;
        if (!(material.emission[i] >= 0)) material.emission[i] = 0;
      }
      if (!parsed.diffuse_texname.empty()) {
        noteOptions(parsed.diffuse_texname, parsed.diffuse_texopt);
        material.texture = findPicture(parsed.diffuse_texname, mesh_.textures, textures_);
      }
      if (!parsed.alpha_texname.empty()) {
        noteOptions(parsed.alpha_texname, parsed.alpha_texopt);
        material.mask = findPicture(parsed.alpha_texname, mesh_.masks, masks_);
      }
      if (material.opacity == 0) {
        progress_.note(
            fmt::format("{}: material \"{}\" is clear (d 0 or Tr 1): its faces give no surfels and "
                        "shade nothing",
                        path_, shown(parsed.name)));
      }
      mesh_.materials.push_back(material);
    }
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
        for (std::size_t k = 0; k < count; ++k) {
          SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t corner,
                                   importCorner(faces.indices[index + k], face));
          corners.push_back(corner);
        }
        index += count;
        const int id = i < faces.material_ids.size() ? faces.material_ids[i] : -1;
        const bool has_material = id >= 0 && std::size_t(id) < parsed_.materials.size();
        const std::uint32_t material =
            material_begin_ + (has_material ? 1 + std::uint32_t(id) : 0u);
        SURFEIT_RETURN_IF_ERROR(builder_.addFace(corners, material, vertex_begin_, path_, face));
      }
      if (index != faces.indices.size()) return tooManyCorners();
    }
    return {};
  }

 private:
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
    if (has_colors_) {
      const glm::vec3 srgb = vector(attributes.colors, corner.vertex) / largest_color_;
      mesh_.color.emplace_back(linearFromSrgb(srgb.x), linearFromSrgb(srgb.y),
                               linearFromSrgb(srgb.z));
    }
    return found->second;
  }

  // Colors are sRGB, from 0 to 1 or in codes of 8 bits.
  void findColorRange() {
    double most = 0;
    for (const double value : parsed_.attributes.colors) most = std::max(most, value);
    if (most <= 1) return;
    largest_color_ = 255;
    progress_.note(fmt::format(
        "{}: colors of vertices are 0-255 (the largest is {:g}): read as sRGB of 8 bits", path_,
        most));
  }

  void noteOptions(const std::string& name, const tinyobj::texture_option_t& options) {
    const bool is_plain =
        std::all_of(options.scale, options.scale + 2, [](double scale) { return scale == 1; }) &&
        std::all_of(options.origin_offset, options.origin_offset + 2,
                    [](double offset) { return offset == 0; });
    if (is_plain) return;
    progress_.note(
        fmt::format("{}: options -s and -o of texture {} are not applied: bake them into "
                    "the texture coordinates",
                    path_, name));
  }

  // Index of the picture of that name; one that cannot be read is told once and left out.
  template <typename Picture>
  std::uint32_t findPicture(std::string name, std::vector<Picture>& pictures,
                            std::map<std::string, std::uint32_t>& known) {
    const auto [found, is_new] = known.try_emplace(name, kNoTexture);
    if (!is_new) return found->second;
    std::replace(name.begin(), name.end(), '\\', '/');  // written on Windows
    Result<Picture> loaded =
        Picture::load((std::filesystem::path(directoryOf(path_)) / name).string());
    if (!loaded.ok()) {
      progress_.note(fmt::format("{}: texture left out: {}", path_, loaded.status().message()));
      return kNoTexture;
    }
    if constexpr (std::is_same_v<Picture, Texture>) {
      if (loaded->hasAlpha()) {
        progress_.note(fmt::format(
            "{}: the alpha of texture {} is not used: map_d {} in the material cuts by it", path_,
            name, name));
      }
    }
    found->second = std::uint32_t(pictures.size());
    pictures.push_back(std::move(*loaded));
    return found->second;
  }

  const std::string& path_;
  const ParsedObj& parsed_;
  MeshBuilder& builder_;
  Mesh& mesh_;
  Progress& progress_;
  bool has_normals_, has_uvs_, has_colors_;
  std::uint64_t vertex_begin_;
  std::uint32_t material_begin_;
  std::unordered_map<Corner, std::uint64_t, CornerHash> vertices_;
  std::map<std::string, std::uint32_t> textures_, masks_;
  double largest_color_ = 1;
};

}  // namespace

Status loadObjMesh(const std::string& path, const glm::vec3& default_albedo, MeshBuilder& builder,
                   Progress& progress) {
  ParsedObj parsed;
  SURFEIT_RETURN_IF_ERROR(parseObj(path, parsed));
  noteWarnings(path, parsed.warnings, progress);
  noteLeftOut(path, parsed, progress);
  ObjImporter importer(path, parsed, default_albedo, builder, progress);
  importer.importMaterials();
  return importer.importFaces();
}

}  // namespace surfeit
