// A gather reads its receivers twice: once to sort them along the scene's curve, and once to write
// them with their results.
//
//   rows --sort--> receivers along the curve --gather (all threads)--> results --by index--> rows
//
// No result depends on any other, so that order, runs and threads show nowhere in them.

#include <fmt/format.h>

#include <memory>
#include <span>
#include <string>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_job.h"
#include "batch/gather_options.h"
#include "batch/result_store.h"
#include "core/guard.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"

namespace surfeit {
namespace {

Status gather(GatherJob& job, SceneFile scene, ExternalSorter& sorter, ResultStore& results,
              GatherStats& stats, Progress& progress) {
  progress.beginPhase("gather", stats.receivers, "receivers");
  progress.advance(stats.invalid_receivers);
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SortedGather> gather,
                           SortedGather::create(std::move(scene), job.memory(), job.options(),
                                                stats, progress, job.environment()));
  SURFEIT_RETURN_IF_ERROR(gather->gather(
      sorter, [&](std::span<const ResultStore::Entry> entries) { return results.put(entries); }));
  gather->finish();
  return {};
}

Result<GatherStats> run(const std::string& receivers_path, const std::string& result_path,
                        const GatherOptions& options, SceneFile scene, Progress& progress) {
  // Spends the budget before anything large is allocated
  SURFEIT_ASSIGN_OR_RETURN(GatherJob job,
                           GatherJob::open(receivers_path, result_path, options, scene, progress));
  GatherStats stats = job.stats();
  const ResultRows rows(job.input().receivers(), options.outputs, options.mode);
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer, job.createWriter(rows));
  SURFEIT_RETURN_IF_ERROR(job.note(scene));

  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<ExternalSorter> sorter, job.sort(scene.header()));
  stats.invalid_receivers = job.input().defects().total();
  ResultStore results({.count = stats.receivers,
                       .outputs = options.outputs,
                       .memory_bytes = job.memory().result_bytes,
                       .temporary_directory = job.temporaryDirectory()});
  SURFEIT_RETURN_IF_ERROR(gather(job, std::move(scene), *sorter, results, stats, progress));
  stats.temporary_bytes = sorter->temporaryBytes() + results.temporaryBytes();
  sorter.reset();
  SURFEIT_RETURN_IF_ERROR(results.finish());
  SURFEIT_RETURN_IF_ERROR(job.write(rows, results, *writer));
  return stats;
}

}  // namespace

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& given,
                                Progress& progress) {
  return guarded(result_path, [&]() -> Result<GatherStats> {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openSceneFor(scene_path, result_path, given));
    return run(receivers_path, result_path, withDefaults(given), std::move(scene), progress);
  });
}

}  // namespace surfeit
