// The text of a recipe (surfeit/generate.h). Surfels are calculated when it is read
// (surfels/generated/scene_generator.h); docs/generate.md has the format.
#pragma once

#include <string>
#include <string_view>

#include "surfeit/generate.h"
#include "surfeit/status.h"

namespace surfeit {

// How a recipe begins.
inline constexpr std::string_view kRecipeMagic = "surfeit-recipe ";

// The text of a recipe. Parsing it again gives the same recipe.
std::string formatSceneRecipe(const SceneRecipe& recipe);

// Safe on arbitrary text. kCorruption, naming `path` and line, for what is no recipe: a wrong first
// line, an unknown, repeated or missing key, a value that is none or out of range.
Result<SceneRecipe> parseSceneRecipe(std::string_view text, const std::string& path);

}  // namespace surfeit
