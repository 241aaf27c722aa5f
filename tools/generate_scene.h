// Writes a generated scene as a surfel cloud. Shared by `surfeit generate` and the benches.
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfels/generated/scene_recipe.h"

namespace surfeit {

struct GenerateStats {
  std::uint64_t surfels = 0;  // records written
  double area = 0;            // of the whole scene, m^2
};

// Writes the records of `recipe` to `output` as PLY, made in `threads` threads and written in
// order: the file does not depend on the threads. It appears when complete. Memory does not grow
// with the scene. Errors: kInvalidArgument (the recipe), kIoError, kInterrupted.
Result<GenerateStats> generateScene(const SceneRecipe& recipe, const std::string& output,
                                    int threads, Progress& progress);

// Writes the recipe itself.
Status writeSceneRecipe(const SceneRecipe& recipe, const std::string& output);

}  // namespace surfeit
