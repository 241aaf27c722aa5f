#include "tools/index_options.h"

#include <fmt/format.h>

#include "surfeit/group_names.h"
#include "tools/channel_options.h"
#include "tools/normal_options.h"
#include "tools/number_list.h"
#include "tools/up_option.h"

namespace surfeit {
namespace {

constexpr const char* kCubeWords = "a scene (.sft), or four numbers X,Y,Z,SIZE";

NamedInput parseNamedInput(const std::string& text) {
  const std::size_t equals = text.find('=');
  const NamedInput input = {text.substr(0, equals),
                            equals == text.npos ? "" : text.substr(equals + 1)};
  const Status named = checkGroupName(input.name);
  if (!named.ok()) throw CLI::ValidationError("--group", named.message());
  if (input.path.empty()) {
    throw CLI::ValidationError("--group",
                               fmt::format("found \"{}\", expected NAME=FILE: a cloud", text));
  }
  return input;
}

Repeats parseRepeats(const std::string& text) {
  if (text == "keep") return Repeats::kKeep;
  if (text == "thin") return Repeats::kThin;
  const bool is_number = !text.empty() && text.find_first_not_of("+-.0123456789e") == text.npos;
  throw CLI::ValidationError(
      "--overlap",
      fmt::format("found {}, expected keep or thin{}", text,
                  is_number
                      ? fmt::format(" (disk area over surfel area is --disk-overlap {})", text)
                      : ""));
}

// --cube, four numbers or the name of a scene.
void parseCube(const std::string& text, IndexSettings& settings) {
  if (text.find_first_not_of("+-.0123456789eE, ") != std::string::npos) {
    settings.cube_like = text;
    return;
  }
  const auto numbers = parseNumberList<4>("--cube", text, kCubeWords);
  settings.options.cube = {{numbers[0], numbers[1], numbers[2]}, numbers[3]};
}

// Cube and origin of the scene of --cube.
Status takeCube(IndexSettings& settings) {
  IndexOptions& options = settings.options;
  if (settings.cube_like.empty()) return {};
  const Result<SceneInfo> like = readSceneInfo(settings.cube_like);
  if (!like.ok()) {
    return Status(like.status().code(),
                  fmt::format("--cube: expected {}: {}", kCubeWords, like.status().message()));
  }
  options.cube = like->cube;
  if (!options.origin) options.origin = like->origin;
  return {};
}

}  // namespace

void addIndexOptions(CLI::App& command, IndexSettings& settings) {
  IndexOptions& options = settings.options;
  command.add_option("CLOUD", settings.inputs,
                     "Surfel clouds (docs/files.md, or recipes of generate), in any order");
  command
      .add_option_function<std::vector<std::string>>(
          "--group",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) options.named.push_back(parseNamedInput(text));
          },
          "A cloud whose surfels are an object group of that name, for --subset NAME; repeatable")
      ->type_name("NAME=FILE")
      ->type_size(1)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option("-o,--output", settings.output, "Scene file to write (.sft)")->required();
  addChannelOptions(command, options.channels, options.part, options.filter);
  addColorRangeOption(command, options.color_range);
  command.add_option("--leaf", options.leaf_capacity, "The most surfels in a leaf of the octree")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  command
      .add_option("--disk-overlap", options.disk_overlap,
                  "Disk area over surfel area, where radius or area is missing")
      ->check(CLI::Range(1.0, 16.0))
      ->capture_default_str();
  command
      .add_option_function<std::string>(
          "--overlap",
          [&options](const std::string& text) { options.repeats = parseRepeats(text); },
          "Surfels that repeat another at the same position, where tiles overlap: keep all, or "
          "thin "
          "to one")
      ->type_name("keep|thin")
      ->default_str("keep");
  command
      .add_option("--normals", settings.normals,
                  "Surfels without a normal: none (spheres), or estimate from their neighbours")
      ->check(CLI::IsMember({"none", "estimate"}))
      ->capture_default_str();
  addNormalOptions(command, settings.estimation);
  command.add_option("--precision", settings.precision, "quantized, or full (floats)")
      ->check(CLI::IsMember({"quantized", "full"}))
      ->capture_default_str();
  command
      .add_option_function<std::string>(
          "--origin",
          [&options](const std::string& text) {
            const auto at = parseNumberList<3>("--origin", text, "three numbers X,Y,Z");
            options.origin = glm::dvec3(at[0], at[1], at[2]);
          },
          "Origin of positions in the scene (default: 0, or a corner of a cloud far away)")
      ->type_name("X,Y,Z");
  command
      .add_option_function<std::string>(
          "--cube", [&settings](const std::string& text) { parseCube(text, settings); },
          "Root cube, least coordinates and edge, or that of another scene: scenes of a "
          "sequence that share it do not pop when something leaves (default: the least "
          "cube)")
      ->type_name("LIKE.sft|X,Y,Z,SIZE");
  addUpOption(command, options.up, "Axis that is up in the scene",
              "as the clouds state, z for LAS, else y");
  addTemporaryOption(command, options.temporary_directory);
}

Status completeIndexOptions(IndexSettings& settings, const CommonOptions& common) {
  IndexOptions& options = settings.options;
  SURFEIT_RETURN_IF_ERROR(takeCube(settings));
  options.threads = common.threads;
  options.full_precision = settings.precision == "full";
  options.strict = common.strict;
  if (settings.normals == "estimate") options.normals = settings.estimation;
  options.memory_bytes = common.memory_bytes;
  return {};
}

}  // namespace surfeit
