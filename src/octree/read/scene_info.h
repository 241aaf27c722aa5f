// What an open scene says about itself.
#pragma once

#include "octree/read/scene_file.h"
#include "surfeit/scene.h"
#include "surfeit/status.h"

namespace surfeit {

// Of a scene with groups reads the first page. Errors: as SceneFile::decodeNodes.
Result<SceneInfo> sceneInfo(const SceneFile& file);

}  // namespace surfeit
