// Meshes and what stands around them, as the sampler, the photon tracer and the reference have
// them.
#pragma once

#include <string>
#include <vector>

#include "sample/meshes/mesh.h"
#include "surfeit/progress.h"
#include "surfeit/sample.h"
#include "surfeit/status.h"

namespace surfeit {

// kInvalidArgument, saying which value, when lights or ground cannot work.
Status checkSurroundings(const Surroundings& surroundings);

// The meshes (loadMeshes) on their ground, as the surroundings have it.
Result<Mesh> loadScene(const std::vector<std::string>& meshes, const Surroundings& surroundings,
                       Progress& progress, SampleGroups groups = SampleGroups::kNone);

}  // namespace surfeit
