#include "random/random_scene_files.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <system_error>
#include <vector>

#include "cloud/ply/ply_writer.h"
#include "random/indexed_scene.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

Status writeReceivers(const RandomScene& scene, const std::string& path) {
  std::vector<RowProperty> properties;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) {
    RowProperty& property = properties.emplace_back();
    property.name = name;
    property.type = ValueType::kFloat32;
  }
  SURFEIT_ASSIGN_OR_RETURN(PlyWriter writer,
                           PlyWriter::create(path, PlyEncoding::kBinaryLittleEndian, properties));
  std::vector<std::byte> row(2 * sizeof(glm::vec3));
  for (const RandomReceiver& one : scene.receivers) {
    std::memcpy(row.data(), &one.receiver.position, sizeof(glm::vec3));
    std::memcpy(row.data() + sizeof(glm::vec3), &one.receiver.normal, sizeof(glm::vec3));
    SURFEIT_RETURN_IF_ERROR(writer.writeRows(row));
  }
  return writer.finish();
}

Status writeMesh(const RandomScene& scene, const std::string& path) {
  std::ofstream file(path);
  for (const RandomTriangle& triangle : scene.triangles) {
    for (const glm::vec3& corner : triangle.corners) {
      file << fmt::format("v {} {} {}\n", corner.x, corner.y, corner.z);
    }
  }
  int group = -1;
  for (std::size_t i = 0; i < scene.triangles.size(); ++i) {
    if (scene.triangles[i].ingredient != group) {
      group = scene.triangles[i].ingredient;
      file << fmt::format("g {}\n", scene.ingredients[std::size_t(group)].text);
    }
    file << fmt::format("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3);
  }
  file.close();
  return file.good() ? Status() : Status::ioError(path + ": cannot be written");
}

const char* modeWord(GatherMode mode) {
  return mode == GatherMode::kOcclusion  ? "occlusion"
         : mode == GatherMode::kBleeding ? "bleeding"
                                         : "glossy";
}

const char* sidesWord(GatherSides sides) {
  return sides == GatherSides::kFront ? "front" : sides == GatherSides::kBoth ? "both" : "back";
}

}  // namespace

Status writeRandomScene(const RandomScene& scene, const std::string& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) return Status::ioError(fmt::format("{}: {}", directory, error.message()));
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer, SurfelWriter::create(directory + "/scene.ply",
                                                                     channelsOf(scene.surfels)));
  SURFEIT_RETURN_IF_ERROR(writer.write(scene.surfels));
  SURFEIT_RETURN_IF_ERROR(writer.finish());
  SURFEIT_RETURN_IF_ERROR(writeReceivers(scene, directory + "/receivers.ply"));
  return writeMesh(scene, directory + "/mesh.obj");
}

std::string gatherCommands(const std::string& directory, const GatherOptions& options) {
  const GatherQuality& quality = options.quality;
  const std::string common = fmt::format(
      "surfeit gather {0}/scene.sft {0}/receivers.ply --mode {1} --sides {2} "
      "--raster-resolution {3} --near-field {4}",
      directory, modeWord(options.mode), sidesWord(quality.sides), quality.raster_resolution,
      quality.near_field_radii);
  return fmt::format(
      "surfeit index {0}/scene.ply -o {0}/scene.sft\n"
      "{1} --max-solid-angle {2} -o {0}/fast.ply\n"
      "{1} --max-solid-angle 0 -o {0}/exact.ply\n",
      directory, common, quality.max_solid_angle);
}

}  // namespace surfeit
