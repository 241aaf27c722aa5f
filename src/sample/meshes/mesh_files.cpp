// What else is read with a mesh (surfeit/mesh_files.h).
#include "surfeit/mesh_files.h"

#include <filesystem>
#include <istream>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/text_case.h"
#include "sample/meshes/obj_material_files.h"

namespace surfeit {
namespace {

// Reads the material files that the lines of an OBJ file name.
void readMaterialFiles(std::istream& lines, MaterialFiles& files,
                       std::vector<tinyobj::material_t>& materials) {
  constexpr std::string_view kStatement = "mtllib ";
  std::map<std::string, int> ids;
  std::string warnings, errors;  // told when the mesh is loaded
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(kStatement)) continue;
    files(line.substr(kStatement.size()), &materials, &ids, &warnings, &errors);
  }
}

}  // namespace

std::vector<std::string> filesNamedByMesh(const std::string& mesh) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(mesh, ignored)) return {};
  if (!hasEnding(mesh, ".obj")) return {};

  // The parser's own readers, so that both find the same files
  Result<ByteInput> input = ByteInput::open(mesh);
  if (!input.ok()) return {};
  ObjLines lines(std::move(*input));
  std::istream stream(&lines);
  const std::string directory = directoryOf(mesh);
  MaterialFiles files(directory);
  std::vector<tinyobj::material_t> materials;
  readMaterialFiles(stream, files, materials);

  std::vector<std::string> paths = files.paths();
  for (const tinyobj::material_t& material : materials) {
    const auto source = files.sources().find(material.name);
    const std::string& beside =
        source != files.sources().end() ? source->second.directory : directory;
    for (const std::string& name :
         {material.diffuse_texname, material.alpha_texname, material.emissive_texname}) {
      if (name.empty()) continue;
      const std::string path = findPictureFile(name, {directory, beside});
      if (std::filesystem::is_regular_file(path, ignored)) paths.push_back(path);
    }
  }
  return paths;
}

}  // namespace surfeit
