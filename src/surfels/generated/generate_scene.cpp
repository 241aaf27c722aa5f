#include <algorithm>
#include <atomic>
#include <optional>
#include <span>
#include <vector>

#include "core/guard.h"
#include "core/parallel.h"
#include "core/resident_limit.h"
#include "core/up_comment.h"
#include "surfeit/generate.h"
#include "surfeit/output.h"
#include "surfels/generated/scene_generator.h"
#include "surfels/generated/scene_recipe.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kBatchSurfels = 16384;  // 1 MiB
constexpr std::size_t kBatchesPerThread = 3;    // one to make, one to write, one to wait
// Batches on their way; a scene that is written as it is made takes no more.
constexpr std::uint64_t kGenerateBytes = 10 << 20, kGenerateThreadBytes = 4 << 20;

struct Batch {
  std::uint64_t begin = 0;  // record
  std::vector<Surfel> surfels;
};

// Makes batches in parallel and writes them in order; their memory is used again and again.
Status writeRecords(const SceneGenerator& generator, int threads, SurfelWriter& writer,
                    Progress& progress) {
  const std::size_t batch_count = kBatchesPerThread * std::size_t(threads);
  std::vector<Batch> batches(batch_count);
  Status status;
  std::atomic<bool> has_failed = false;

  const std::uint64_t total = generator.recordCount();
  std::uint64_t dealt = 0;
  const auto deal = [&]() -> std::optional<std::size_t> {
    if (has_failed || progress.isCancelled() || dealt >= total) return std::nullopt;
    const std::size_t slot = std::size_t(dealt / kBatchSurfels % batch_count);
    batches[slot].begin = dealt;
    dealt += std::min(kBatchSurfels, total - dealt);
    return slot;
  };
  const auto make = [&](std::size_t slot) {
    Batch& batch = batches[slot];
    batch.surfels.resize(std::size_t(std::min(kBatchSurfels, total - batch.begin)));
    generator.generate(batch.begin, batch.surfels);
  };
  const auto write = [&](std::size_t slot) {
    if (!status.ok()) return;
    const Batch& batch = batches[slot];
    status = writer.write(batch.surfels);
    has_failed = !status.ok();
    progress.advance(batch.surfels.size());
  };
  using Mode = PipelineStage::Mode;
  const PipelineStage stages[] = {{Mode::kParallel, make}, {Mode::kInOrder, write}};
  withThreads(threads, [&] { runPipeline(batch_count, deal, stages); });
  if (status.ok() && progress.isCancelled()) return Status::interrupted();
  return status;
}

}  // namespace

Result<GenerateStats> generateScene(const SceneRecipe& recipe, const std::string& output,
                                    int threads, Progress& progress) {
  return guarded(output, [&]() -> Result<GenerateStats> {
    SURFEIT_RETURN_IF_ERROR(checkResidentBytes(
        "generate", kGenerateBytes + kGenerateThreadBytes * std::uint64_t(threads)));
    SURFEIT_ASSIGN_OR_RETURN(const SceneGenerator generator, SceneGenerator::create(recipe));
    progress.beginPhase("generate", generator.recordCount(), "surfels");
    SURFEIT_ASSIGN_OR_RETURN(
        SurfelWriter writer,
        SurfelWriter::create(output, generator.channels(),
                             {.comments = {upComment(kGeneratedUpAxis)}, .progress = &progress}));
    SURFEIT_RETURN_IF_ERROR(writeRecords(generator, threads, writer, progress));
    SURFEIT_RETURN_IF_ERROR(writer.finish());
    return GenerateStats{generator.recordCount(), generator.area()};
  });
}

Status writeSceneRecipe(const SceneRecipe& recipe, const std::string& output) {
  SURFEIT_RETURN_IF_ERROR(checkSceneRecipe(recipe));
  return writeOutput(output, formatSceneRecipe(recipe));
}

}  // namespace surfeit
