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
#include "batch/gather_scene.h"
#include "batch/result_store.h"
#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bake.h"
#include "surfeit/kept_scene.h"

namespace surfeit {
namespace {

// Gathers, and gives the octree back with what was read into its caches.
Result<std::unique_ptr<PagedOctree>> gather(GatherJob& job, GatherScene& scene,
                                            ExternalSorter& sorter, ResultStore& results,
                                            GatherStats& stats, Progress& progress) {
  progress.beginPhase("gather", stats.receivers, "receivers");
  progress.advance(stats.invalid_receivers);
  const bool is_warm = scene.isWarm();
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           scene.takeOctree(job.memory().caches));
  const std::unique_ptr<SortedGather> gather = SortedGather::create(
      std::move(octree), is_warm, job.memory(), job.options(), stats, progress, job.environment());
  SURFEIT_RETURN_IF_ERROR(gather->gather(
      sorter, [&](std::span<const ResultStore::Entry> entries) { return results.put(entries); }));
  gather->finish();
  return gather->takeOctree();
}

Result<GatherStats> run(const std::string& receivers_path, const std::string& result_path,
                        const GatherOptions& options, GatherScene scene, Progress& progress) {
  // Spends the budget before anything large is allocated
  SURFEIT_ASSIGN_OR_RETURN(
      GatherJob job, GatherJob::open(receivers_path, result_path, options, scene.file(), progress));
  SURFEIT_RETURN_IF_ERROR(scene.makeRoom(job.memory()));
  if (scene.isWarm()) job.sortBesideCaches();
  GatherStats stats = job.stats();
  const ResultRows rows(job.input().receivers(), options.outputs, options.mode);
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer, job.createWriter(rows));
  SURFEIT_RETURN_IF_ERROR(job.note(scene.file()));

  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<ExternalSorter> sorter, job.sort(scene.file().header()));
  stats.invalid_receivers = job.input().defects().total();
  ResultStore results({.count = stats.receivers,
                       .outputs = options.outputs,
                       .memory_bytes = job.memory().result_bytes,
                       .temporary_directory = job.temporaryDirectory()});
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           gather(job, scene, *sorter, results, stats, progress));
  stats.temporary_bytes = sorter->temporaryBytes() + results.temporaryBytes();
  sorter.reset();
  // A writer that holds all rows takes the memory of the caches
  if (heldWriterBytes(result_path, stats.receivers, rows.rowBytes()) == 0) {
    scene.keep(std::move(octree), job.memory());
  }
  octree.reset();
  SURFEIT_RETURN_IF_ERROR(results.finish());
  SURFEIT_RETURN_IF_ERROR(job.write(rows, results, *writer));
  return stats;
}

Result<GatherStats> gatherIn(KeptScene::State* kept, const std::string& scene_path,
                             const std::string& receivers_path, const std::string& result_path,
                             const GatherOptions& given, Progress& progress) {
  return guarded(result_path, [&]() -> Result<GatherStats> {
    SURFEIT_ASSIGN_OR_RETURN(GatherScene scene,
                             GatherScene::open(scene_path, result_path, given, kept, progress));
    return run(receivers_path, result_path, withDefaults(given), std::move(scene), progress);
  });
}

}  // namespace

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress) {
  return gatherIn(nullptr, scene_path, receivers_path, result_path, options, progress);
}

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress, KeptScene& kept) {
  return gatherIn(&kept.state(), scene_path, receivers_path, result_path, options, progress);
}

}  // namespace surfeit
