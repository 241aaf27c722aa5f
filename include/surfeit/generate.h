// Generated scenes: surfel clouds of any size from a few numbers, the same on every machine, for
// tests of scale (docs/generate.md). A recipe is a file of a few lines that stands for such a
// cloud: every job that reads clouds takes it in place of one.
//
// Lengths are metres. Functions are safe from any thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/api.h"
#include "surfeit/progress.h"
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
SURFEIT_API Status checkSceneRecipe(const SceneRecipe& recipe);

SURFEIT_API const char* sceneKindName(SceneKind kind);
SURFEIT_API const char* recordOrderName(RecordOrder order);
// kInvalidArgument for another name than terrain, city and volume, or scan and shuffled.
SURFEIT_API Result<SceneKind> parseSceneKind(std::string_view name);
SURFEIT_API Result<RecordOrder> parseRecordOrder(std::string_view name);
// "10M", "1G", "2.5k", "4096": 1 to kMaxRecipeSurfels; units are powers of 1000.
SURFEIT_API Result<std::uint64_t> parseSurfelCount(std::string_view text);
// "2/5": sets part and part_count.
SURFEIT_API Status parseScenePart(std::string_view text, SceneRecipe& recipe);

struct GenerateStats {
  std::uint64_t surfels = 0;  // records written
  double area = 0;            // of the whole scene, m^2
};

// Writes the records of `recipe` to `output`, a cloud of the format that its name tells, made in
// `threads` threads (at least 1) and written in order: the file does not depend on the threads. It
// appears when complete. Takes some 10 MiB and 4 for each thread, however large the scene. Errors:
// kInvalidArgument (the recipe), kIoError, kInterrupted, kBudgetTooSmall (limitProcess).
SURFEIT_API Result<GenerateStats> generateScene(const SceneRecipe& recipe,
                                                const std::string& output, int threads,
                                                Progress& progress);

// Writes the recipe itself. Errors: kInvalidArgument, kIoError.
SURFEIT_API Status writeSceneRecipe(const SceneRecipe& recipe, const std::string& output);

}  // namespace surfeit
