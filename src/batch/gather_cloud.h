// The gather from file to file.
#pragma once

#include <string>

#include "surfeit/bake.h"
#include "surfeit/kept_scene.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// gatherCloud (surfeit/bake.h) in the scene that is kept (surfeit/kept_scene.h); null: none is.
Result<GatherStats> gatherCloudIn(KeptScene::State* kept, const std::string& scene_path,
                                  const std::string& receivers_path, const std::string& result_path,
                                  const GatherOptions& options, Progress& progress);

}  // namespace surfeit
