// Random scenes as files, and the commands that gather from them with the program.
#pragma once

#include <cstdint>
#include <string>

#include "random/random_scene.h"
#include "surfeit/bake.h"
#include "surfeit/status.h"

namespace surfeit {

// Writes scene.ply, receivers.ply and mesh.obj into a directory, which is made. Points are no part
// of the mesh.
Status writeRandomScene(const RandomScene& scene, const std::string& directory);

// Lines of shell that gather from these files with the options' quality, and exactly. Of a scene
// that was cut down, `kept` is the set of ingredients.
std::string gatherCommands(const std::string& directory, const GatherOptions& options);

}  // namespace surfeit
