// Sets of groups of surfels (surfeit/scene.h has them in words) that a scene must have.
#pragma once

#include <cstdint>

#include "octree/read/scene_file.h"
#include "surfeit/scene.h"
#include "surfeit/status.h"
#include "surfeit/surfel.h"

namespace surfeit {

// Whether these groups can be chosen from the scene. kCorruption when it has no groups,
// kInvalidArgument when none of these is there, with those that are; any scene has kAllGroups.
// Reads the first page of a scene with groups; errors as of decodeNodes.
Status checkGroups(const SceneFile& scene, std::uint64_t groups);

}  // namespace surfeit
