#include "surfels/open_surfel_source.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

#include "cloud/cloud_formats.h"
#include "storage/file.h"
#include "surfels/generated/recipe_surfel_source.h"
#include "surfels/generated/scene_recipe.h"

namespace surfeit {
namespace {

// Whether the file stands for a generated scene.
Result<bool> isRecipe(const std::string& path) {
  std::array<std::byte, kRecipeMagic.size()> magic{};
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  return std::string_view(reinterpret_cast<const char*>(magic.data()), size) == kRecipeMagic;
}

}  // namespace

Result<std::unique_ptr<SurfelSource>> openSurfelSource(const std::string& path, bool strict,
                                                       const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_recipe, isRecipe(path));
  if (is_recipe && !options.filter.empty()) {
    return Status::invalidArgument(
        fmt::format("{}: a generated scene, which has no rows to filter", path));
  }
  if (is_recipe) return openRecipeSource(path);
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openRowReader(path, options));
  return makeSurfelSource(std::move(reader), strict);
}

}  // namespace surfeit
