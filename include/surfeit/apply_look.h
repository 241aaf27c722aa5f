// The look of bounce light (surfeit/bounce_look.h) for programs that gather with the engine
// (surfeit/engine.h), which gives light as it arrives. Jobs on files apply it themselves.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "surfeit/api.h"
#include "surfeit/bounce_look.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// Corrects `irradiance` (light from surfels, the output of a gather) at `count` receivers by their
// positions and normals; views do not matter. Light that is NaN stays. Positions become floats
// about `origin`: take a place near the receivers. With the origin of the scene
// (SceneInfo::origin), its own coordinates and equal irradiance, results have the bits of
// gatherCloud (surfeit/bake.h). Safe from any thread. Errors: kInvalidArgument (look), before
// anything is changed.
SURFEIT_API Status applyLook(const BounceLook& look, const glm::dvec3& origin,
                             const Receiver* receivers, std::size_t count, glm::vec3* irradiance);

}  // namespace surfeit
