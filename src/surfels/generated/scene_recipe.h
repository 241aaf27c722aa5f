// A recipe: a few lines of text that stand for a surfel cloud of any size, whose surfels are
// calculated when they are read (surfels/generated/scene_generator.h). docs/generate.md has the
// format.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/status.h"

namespace surfeit {

enum class SceneKind : std::uint8_t {
  kTerrain,  // hills
  kCity,     // gentle hills, boxes of varied heights, spheres, trees with crowns of leaves
  kVolume,   // a cube of haze: spheres without normals, uniform in space
};

enum class RecordOrder : std::uint8_t {
  kScan,      // lot by lot in strips, object by object, row by row: as a scanner would deliver
  kShuffled,  // the same records in an order without any locality
};

// Most surfels of a recipe, as for the other commands that make surfels.
inline constexpr std::uint64_t kMaxRecipeSurfels = std::uint64_t{1} << 40;

struct SceneRecipe {
  SceneKind kind = SceneKind::kCity;
  std::uint64_t surfels = 10'000'000;  // 1 to kMaxRecipeSurfels; all parts together
  std::uint64_t seed = 1;              // another seed, another scene of the same kind
  RecordOrder order = RecordOrder::kScan;
  // Of `part_count` equal runs of records, the one that the recipe stands for, from 1.
  std::uint32_t part = 1, part_count = 1;
  // Metres from the middle of the scene to one more surfel, the last record; 0: there is none.
  double outlier_distance = 0;
  // Percentage of the records that repeat an earlier record exactly, 0 to 100.
  double duplicate_percent = 0;
};

// kInvalidArgument when a value is out of range, saying which, found and expected.
Status checkSceneRecipe(const SceneRecipe& recipe);

const char* sceneKindName(SceneKind kind);
const char* recordOrderName(RecordOrder order);
// kInvalidArgument for another name than terrain, city and volume, or scan and shuffled.
Result<SceneKind> parseSceneKind(std::string_view name);
Result<RecordOrder> parseRecordOrder(std::string_view name);
// "10M", "1G", "2.5k", "4096": 1 to kMaxRecipeSurfels; units are powers of 1000.
Result<std::uint64_t> parseSurfelCount(std::string_view text);
// "2/5": sets part and part_count.
Status parseScenePart(std::string_view text, SceneRecipe& recipe);

// How a recipe begins.
inline constexpr std::string_view kRecipeMagic = "surfeit-recipe ";

// The text of a recipe. Parsing it again gives the same recipe.
std::string formatSceneRecipe(const SceneRecipe& recipe);

// Safe on arbitrary text. kCorruption, naming `path` and line, for what is no recipe: a wrong first
// line, an unknown, repeated or missing key, a value that is none or out of range.
Result<SceneRecipe> parseSceneRecipe(std::string_view text, const std::string& path);

}  // namespace surfeit
