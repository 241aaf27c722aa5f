// Materials of an OBJ file and their pictures, as materials of a mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "sample/meshes/mesh.h"
#include "sample/meshes/obj_material_files.h"

namespace surfeit {

class ObjMaterials {
 public:
  // Appends to the mesh's materials: first the one of faces without a material, then those that
  // were parsed, in their order. All arguments outlive the object.
  ObjMaterials(const std::string& path, const std::vector<tinyobj::material_t>& parsed,
               const std::map<std::string, MaterialSource>& sources, const Material& plain,
               Mesh& mesh, Progress& progress);

  // Of a face with the parser's material `id` (outside them: none), into the mesh's materials.
  // Faces without texture coordinates get a copy without pictures, and are counted.
  std::uint32_t ofFace(int id, bool has_uv);
  // Of faces without a material.
  std::uint32_t plain() const { return begin_; }
  bool has(int id) const { return id >= 0 && std::size_t(id) < parsed_.size(); }

  // Tells which faces lack texture coordinates.
  void noteFacesWithoutUv() const;

 private:
  // A material without its pictures.
  struct Bare {
    Material material;
    std::uint32_t index = 0;  // into the mesh's materials; 0: not yet there
    std::uint64_t faces = 0, faces_of_all = 0;
  };

  void import(int id, const MaterialSource& source);
  glm::vec3 colorOf(const tinyobj::material_t& parsed, const char* statement,
                    const double (&rgb)[3], double most) const;
  glm::vec3 reflectanceOf(const tinyobj::material_t& parsed) const;
  void importScattering(const tinyobj::material_t& parsed, bool is_translucent, Material& material);
  void importPictures(const tinyobj::material_t& parsed, const std::string& directory,
                      Material& material);
  void importWithoutKd(const tinyobj::material_t& parsed, Material& material);
  template <typename Picture>
  std::uint32_t findPicture(const std::string& name, const tinyobj::texture_option_t& options,
                            const std::string& directory, std::vector<Picture>& pictures,
                            std::map<std::string, std::uint32_t>& known);
  void note(const tinyobj::material_t& material, const std::string& text) const;

  const std::string& path_;
  const std::vector<tinyobj::material_t>& parsed_;
  Mesh& mesh_;
  Progress& progress_;
  std::uint32_t begin_;
  std::map<int, Bare> bare_;                               // of those that have pictures, by id
  std::map<std::string, std::uint32_t> textures_, masks_;  // by path
};

}  // namespace surfeit
