#include "batch/gather_options.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "batch/bounce_look.h"
#include "batch/environment_file.h"
#include "core/job_limits.h"
#include "core/up_comment.h"
#include "gather/rules/check_settings.h"
#include "gather/rules/gather_outputs.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/raster_geometry.h"
#include "octree/read/group_set.h"
#include "storage/output_target.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

Status refuse(const char* what, auto found, const std::string& expected) {
  return Status::invalidArgument(fmt::format("{} is {}, expected {}", what, found, expected));
}

Status checkEnvironment(const GatherEnvironment& environment) {
  if (!(environment.intensity >= 0 && std::isfinite(environment.intensity))) {
    return refuse("intensity of the environment", environment.intensity, "0 or more");
  }
  if (!std::isfinite(environment.rotation)) {
    return refuse("rotation of the environment", environment.rotation, "radians");
  }
  return {};
}

}  // namespace

Status checkGatherOptions(const GatherOptions& options) {
  SURFEIT_RETURN_IF_ERROR(checkGatherSettings(options, !options.environment.path.empty()));
  SURFEIT_RETURN_IF_ERROR(checkEnvironment(options.environment));
  SURFEIT_RETURN_IF_ERROR(checkLook(options.look));
  if (!options.look.isOff() && (GatherRules(options).outputs & kOutputIrradiance) == 0) {
    return Status::invalidArgument(
        "look of bounce light: found no output irradiance that it changes, expected --mode "
        "bleeding or glossy, or --outputs irradiance");
  }
  SURFEIT_RETURN_IF_ERROR(checkThreadCount(options.threads));
  if (!(options.cache_split <= 1)) {
    return refuse("cache split", options.cache_split, "0 to 1, or a negative number to measure");
  }
  return {};
}

Result<std::unique_ptr<const LoadedEnvironment>> loadEnvironment(const GatherOptions& options,
                                                                 UpAxis scene_up,
                                                                 Progress& progress) {
  GatherEnvironment environment = options.environment;
  if (environment.path.empty()) return std::unique_ptr<const LoadedEnvironment>();
  if (!environment.up) {
    environment.up = scene_up;
    progress.inform(fmt::format("{}: {} is up, as in the scene (--up)", environment.path,
                                upAxisName(scene_up)));
  }
  SURFEIT_ASSIGN_OR_RETURN(EnvironmentMap map, loadEnvironmentMap(environment, progress));
  return std::make_unique<const LoadedEnvironment>(std::move(map),
                                                   options.quality.raster_resolution);
}

Result<SceneFile> openSceneBeside(const std::string& scene_path, const std::string& result_path,
                                  Access access) {
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path, scene_path, "scene"));
  return SceneFile::open(scene_path, access);
}

Status checkGroupsFor(const SceneFile& scene, const GatherOptions& options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkGroups(scene, options.groups));
  std::uint64_t gained = 0;
  for (const GroupGain& of_group : options.gains) gained |= groupBit(of_group.group);
  if (gained == 0) return {};
  SURFEIT_RETURN_IF_ERROR(checkGroups(scene, gained));
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t present, scene.readGroups());
  if (const std::uint64_t absent = gained & ~present; absent != 0) {
    progress.note(fmt::format("{}: has no surfels of groups {}: their gains change nothing",
                              scene.path(), describeGroups(absent)));
  }
  return {};
}

Status checkSceneFor(const SceneFile& scene, const std::string& result_path,
                     const GatherOptions& options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkGatherOptions(options));
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path, scene.path(), "scene"));
  return checkGroupsFor(scene, options, progress);
}

Result<SceneFile> openSceneAsAsked(const std::string& scene_path, const GatherOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(scene_path, sceneAccess(options)));
  scene.stage({options.stage_directory, options.stage_limit_bytes});
  return scene;
}

Result<SceneFile> openSceneFor(const std::string& scene_path, const std::string& result_path,
                               const GatherOptions& options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkGatherOptions(options));
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path, scene_path, "scene"));
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openSceneAsAsked(scene_path, options));
  SURFEIT_RETURN_IF_ERROR(checkGroupsFor(scene, options, progress));
  return scene;
}

GatherOptions withDefaults(GatherOptions options) {
  options.outputs = settledOutputs(options, !options.environment.path.empty());
  if (options.threads == 0) options.threads = defaultThreadCount();
  if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes();
  return options;
}

}  // namespace surfeit
