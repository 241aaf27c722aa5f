// Triangle meshes from Wavefront OBJ and MTL, parsed by tinyobjloader. Nothing that the parser
// returns is trusted: every index is checked here.

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <exception>
#include <filesystem>
#include <map>
#include <unordered_map>

#include "core/spherical_harmonics.h"
#include "io/file.h"
#include "sample/mesh.h"

namespace surfeit {
namespace {

// What tinyobjloader makes of a file.
struct ParsedObj {
  tinyobj::attrib_t attributes;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warnings;
};

Status parseObj(const std::string& path, ParsedObj& parsed) {
  std::string errors;
  const std::string directory = directoryOf(path) + "/";
  bool ok = false;
  try {
    // Polygons stay whole and colors are not made up: we want to see what the file says
    ok = tinyobj::LoadObj(&parsed.attributes, &parsed.shapes, &parsed.materials, &parsed.warnings,
                          &errors, path.c_str(), directory.c_str(), false, false);
  } catch (const std::exception& exception) {
    errors = exception.what();
  }
  if (ok) return {};
  while (!errors.empty() && errors.back() == '\n') errors.pop_back();
  return Status::corruption(fmt::format("{}: {}", path, errors));
}

// First line only: a note is one line.
std::string firstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

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
              Mesh& mesh, Progress& progress)
      : path_(path), parsed_(parsed), mesh_(mesh), progress_(progress) {
    has_normals_ = !parsed.attributes.normals.empty();
    has_uvs_ = !parsed.attributes.texcoords.empty();
    has_colors_ = !parsed.attributes.colors.empty();
    vertex_begin_ = mesh.position.size();
    if (has_normals_) mesh.normal.resize(vertex_begin_, glm::vec3(0));
    if (has_uvs_) mesh.uv.resize(vertex_begin_, glm::vec2(0));
    if (has_colors_) mesh.color.resize(vertex_begin_, glm::vec3(1));

    // Material ids of the file follow the one for faces without a material
    material_begin_ = std::uint32_t(mesh.materials.size());
    Material plain;
    plain.albedo = has_colors_ ? glm::vec3(1) : default_albedo;
    mesh.materials.push_back(plain);
  }

  void importMaterials() {
    for (const tinyobj::material_t& parsed : parsed_.materials) {
      Material material;
      material.albedo = {parsed.diffuse[0], parsed.diffuse[1], parsed.diffuse[2]};
      material.emission =
          kPi * glm::vec3(parsed.emission[0], parsed.emission[1], parsed.emission[2]);
      // Written so that NaN becomes 0 as well
      for (int i = 0; i < 3; ++i) {
        if (!(material.albedo[i] >= 0)) material.albedo[i] = 0;
        if (!(material.emission[i] >= 0)) material.emission[i] = 0;
      }
      if (!parsed.diffuse_texname.empty()) material.texture = texture(parsed.diffuse_texname);
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
        SURFEIT_RETURN_IF_ERROR(addFace(corners, material, vertex_begin_, path_, face, mesh_));
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

    const auto [found, is_new] = vertices_.try_emplace(corner, mesh_.position.size());
    if (!is_new) return found->second;
    const auto vector = [](const std::vector<tinyobj::real_t>& values, int i) {
      const tinyobj::real_t* const value = &values[3 * std::size_t(i)];
      return glm::vec3(value[0], value[1], value[2]);
    };
    mesh_.position.push_back(vector(attributes.vertices, corner.vertex));
    if (has_normals_) {
      mesh_.normal.push_back(corner.normal >= 0 ? vector(attributes.normals, corner.normal)
                                                : glm::vec3(0));
    }
    if (has_uvs_) {
      const std::size_t i = 2 * std::size_t(corner.uv);
      mesh_.uv.push_back(corner.uv >= 0
                             ? glm::vec2(attributes.texcoords[i], attributes.texcoords[i + 1])
                             : glm::vec2(0));
    }
    if (has_colors_) {
      const glm::vec3 srgb = vector(attributes.colors, corner.vertex);
      mesh_.color.emplace_back(linearFromSrgb(srgb.x), linearFromSrgb(srgb.y),
                               linearFromSrgb(srgb.z));
    }
    return found->second;
  }

  // Index of the texture of that name; a picture that cannot be read is told once and left out.
  std::uint32_t texture(std::string name) {
    const auto [found, is_new] = textures_.try_emplace(name, kNoTexture);
    if (!is_new) return found->second;
    for (char& c : name) {
      if (c == '\\') c = '/';  // written on Windows
    }
    Result<Texture> loaded =
        Texture::load((std::filesystem::path(directoryOf(path_)) / name).string());
    if (!loaded.ok()) {
      progress_.note(fmt::format("{}: texture left out: {}", path_, loaded.status().message()));
      return kNoTexture;
    }
    found->second = std::uint32_t(mesh_.textures.size());
    mesh_.textures.push_back(std::move(*loaded));
    return found->second;
  }

  const std::string& path_;
  const ParsedObj& parsed_;
  Mesh& mesh_;
  Progress& progress_;
  bool has_normals_, has_uvs_, has_colors_;
  std::uint64_t vertex_begin_;
  std::uint32_t material_begin_;
  std::unordered_map<Corner, std::uint64_t, CornerHash> vertices_;
  std::map<std::string, std::uint32_t> textures_;
};

}  // namespace

Status loadObjMesh(const std::string& path, const glm::vec3& default_albedo, Mesh& mesh,
                   Progress& progress) {
  ParsedObj parsed;
  SURFEIT_RETURN_IF_ERROR(parseObj(path, parsed));
  if (!parsed.warnings.empty()) {
    progress.note(fmt::format("{}: {}", path, firstLine(parsed.warnings)));
  }
  ObjImporter importer(path, parsed, default_albedo, mesh, progress);
  importer.importMaterials();
  return importer.importFaces();
}

}  // namespace surfeit
