// Checks of what a caller asks for.
#pragma once

#include <memory>
#include <string>

#include "gather/light/environment_map.h"
#include "gather/rules/gather_rules.h"
#include "octree/read/scene_file.h"
#include "storage/positional_file.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// kInvalidArgument, naming the option, what was found and what is expected.
Status checkGatherOptions(const GatherOptions& options);

// kInvalidArgument for a result that would replace its scene.
Result<SceneFile> openSceneBeside(const std::string& scene_path, const std::string& result_path,
                                  Access access = Access::kCached);

// Checks the options, and opens the scene that they are for. A note tells of groups with gains that
// it lacks.
Result<SceneFile> openSceneFor(const std::string& scene_path, const std::string& result_path,
                               const GatherOptions& options, Progress& progress);

// Of options and a scene: groups and gains. Errors: as checkGroups (octree/read/group_set.h).
Status checkGroupsFor(const SceneFile& scene, const GatherOptions& options, Progress& progress);

// The same checks for a scene that is open.
Status checkSceneFor(const SceneFile& scene, const std::string& result_path,
                     const GatherOptions& options, Progress& progress);

// With threads and memory that were left open filled in, from what the job may use.
GatherOptions withDefaults(GatherOptions options);

// The environment that is asked for, ready for a raster of that resolution; null when there is
// none. Errors: as loadEnvironmentMap.
Result<std::unique_ptr<const LoadedEnvironment>> loadEnvironment(const GatherOptions& options,
                                                                 UpAxis scene_up,
                                                                 Progress& progress);

// Opens a scene as the options say its pages are read.
Result<SceneFile> openSceneAsAsked(const std::string& scene_path, const GatherOptions& options);

// How the pages of the scene are read.
inline Access sceneAccess(const GatherOptions& options) {
  return options.direct_io ? Access::kDirect : Access::kCached;
}

}  // namespace surfeit
