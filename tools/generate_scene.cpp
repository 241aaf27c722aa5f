#include "tools/generate_scene.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "core/up_comment.h"
#include "storage/file.h"
#include "surfels/generated/scene_generator.h"
#include "surfels/surfel_source.h"
#include "surfels/surfel_writer.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kBatchSurfels = 16384;  // 1 MiB
constexpr std::size_t kBatchesPerThread = 3;    // one to make, one to write, one to wait

struct Batch {
  std::vector<Surfel> surfels;
};

// Makes batches in parallel and writes them in order; their memory is used again and again.
Status writeRecords(const SceneGenerator& generator, int threads, SurfelWriter& writer,
                    Progress& progress) {
  const std::size_t batch_count = kBatchesPerThread * std::size_t(threads);
  std::vector<Batch> batches(batch_count);
  Status status;
  std::atomic<bool> has_failed = false;

  // Batch i is made in slot i % batch_count, which batch i - batch_count has left: the pipeline
  // lets no more than that many in
  const std::uint64_t total = generator.recordCount();
  std::uint64_t dealt = 0;
  const auto deal = [&](tbb::flow_control& control) -> std::uint64_t {
    if (has_failed || progress.isCancelled() || dealt >= total) {
      control.stop();
      return 0;
    }
    const std::uint64_t begin = dealt;
    dealt += kBatchSurfels;
    return begin;
  };
  const auto slotOf = [&](std::uint64_t begin) -> Batch& {
    return batches[std::size_t(begin / kBatchSurfels % batch_count)];
  };
  const auto make = [&](std::uint64_t begin) {
    Batch& batch = slotOf(begin);
    batch.surfels.resize(std::size_t(std::min(kBatchSurfels, total - begin)));
    generator.generate(begin, batch.surfels);
    return begin;
  };
  const auto write = [&](std::uint64_t begin) {
    if (!status.ok()) return;
    const Batch& batch = slotOf(begin);
    status = writer.write(batch.surfels);
    has_failed = !status.ok();
    progress.advance(batch.surfels.size());
  };
  tbb::parallel_pipeline(
      batch_count,
      tbb::make_filter<void, std::uint64_t>(tbb::filter_mode::serial_in_order, deal) &
          tbb::make_filter<std::uint64_t, std::uint64_t>(tbb::filter_mode::parallel, make) &
          tbb::make_filter<std::uint64_t, void>(tbb::filter_mode::serial_in_order, write));
  if (status.ok() && progress.isCancelled()) return Status::interrupted();
  return status;
}

}  // namespace

Result<GenerateStats> generateScene(const SceneRecipe& recipe, const std::string& output,
                                    int threads, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneGenerator generator, SceneGenerator::create(recipe));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  std::size_t(threads));
  progress.beginPhase("generate", generator.recordCount(), "surfels");
  SURFEIT_ASSIGN_OR_RETURN(
      SurfelWriter writer,
      SurfelWriter::create(output, generator.channels(),
                           {.comments = {upComment(kGeneratedUpAxis)}, .progress = &progress}));
  SURFEIT_RETURN_IF_ERROR(writeRecords(generator, threads, writer, progress));
  SURFEIT_RETURN_IF_ERROR(writer.finish());
  return GenerateStats{generator.recordCount(), generator.area()};
}

Status writeSceneRecipe(const SceneRecipe& recipe, const std::string& output) {
  SURFEIT_RETURN_IF_ERROR(checkSceneRecipe(recipe));
  const std::string text = formatSceneRecipe(recipe);
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(output));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(text))));
  return file.commit();
}

}  // namespace surfeit
