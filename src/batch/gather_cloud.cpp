// A gather reads its receivers twice: once to sort them along the scene's curve, and once to write
// them with their results.
//
//   rows --sort--> receivers along the curve --gather (all threads)--> results --by index--> rows
//
// No result depends on any other, so that order, runs and threads show nowhere in them.
#include "batch/gather_cloud.h"

#include <memory>

#include "batch/gather_job.h"
#include "batch/gather_options.h"
#include "batch/gather_scene.h"
#include "batch/result_store.h"
#include "core/guard.h"
#include "storage/external_sorter.h"

namespace surfeit {
namespace {

Result<GatherStats> sortGatherWrite(GatherJob& job, GatherScene& scene, Progress& progress) {
  GatherStats stats = job.stats();
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<ExternalSorter> sorter, job.sort(scene.file().header()));
  stats.invalid_receivers = job.input().defects().total();

  ResultStore results(job.resultPlan());
  SURFEIT_RETURN_IF_ERROR(scene.gather(job, *sorter, results, stats, progress));
  stats.temporary_bytes = sorter->temporaryBytes() + results.temporaryBytes();
  sorter.reset();

  SURFEIT_RETURN_IF_ERROR(job.write(results));
  return stats;
}

}  // namespace

Result<GatherStats> gatherCloudIn(KeptScene::State* kept, const std::string& scene_path,
                                  const std::string& receivers_path, const std::string& result_path,
                                  const GatherOptions& options, Progress& progress) {
  return guarded(result_path, [&]() -> Result<GatherStats> {
    SURFEIT_ASSIGN_OR_RETURN(GatherScene scene,
                             GatherScene::open(scene_path, result_path, options, kept, progress));
    // Spends the budget before anything large is allocated
    SURFEIT_ASSIGN_OR_RETURN(GatherJob job,
                             GatherJob::open(receivers_path, result_path, withDefaults(options),
                                             scene.file(), progress));
    SURFEIT_RETURN_IF_ERROR(scene.makeRoom(job));
    SURFEIT_RETURN_IF_ERROR(job.createResult());
    SURFEIT_RETURN_IF_ERROR(job.note(scene.file()));
    return sortGatherWrite(job, scene, progress);
  });
}

Result<GatherStats> gatherCloud(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& options,
                                Progress& progress) {
  return gatherCloudIn(nullptr, scene_path, receivers_path, result_path, options, progress);
}

}  // namespace surfeit
