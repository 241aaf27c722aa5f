// Whether a scene gives light.
#pragma once

#include <string>

#include "octree/read/scene_file.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Tells when no surfel of the scene sends light, and what to do: a gather of light, or a bounce,
// would be black. Reads the first page; errors as of SceneFile::decodeNodes.
Status noteDarkness(const SceneFile& scene, Progress& progress);

}  // namespace surfeit
