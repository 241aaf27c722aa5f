// Surfels of a recipe (surfels/generated/scene_recipe.h), read as if they were a file.
#pragma once

#include <memory>
#include <string>

#include "surfeit/status.h"
#include "surfels/rows/surfel_source.h"

namespace surfeit {

// Opens a recipe as a source: the same records as the PLY file that `surfeit generate` makes from
// it. Rows hold nothing, so that readRows costs nothing and decodeRows makes the surfels. Takes
// about 5 MB. kCorruption as parseSceneRecipe.
Result<std::unique_ptr<SurfelSource>> openRecipeSource(const std::string& path);

}  // namespace surfeit
