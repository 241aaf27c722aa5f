#include "octree/build/slab_source.h"

#include <mutex>
#include <optional>
#include <utility>

#include "core/first_failure.h"
#include "core/parallel.h"

namespace surfeit {

Result<bool> CutSlabs::fetch(std::size_t work) {
  SURFEIT_ASSIGN_OR_RETURN(std::optional<Slab> slab, cutter_.next());
  if (!slab) return false;
  slabs_[work] = std::move(*slab);
  return true;
}

Status CutSlabs::build(std::size_t work, BuiltSlab& built) {
  const Status status = buildSlab(slabs_[work], header_, built);
  slabs_[work] = {};
  return status;
}

Status buildSlabs(SlabSource& source, std::size_t works, const SlabTaker& take,
                  Progress& progress) {
  std::vector<BuiltSlab> built(works);
  std::vector<std::size_t> free(works);
  for (std::size_t i = 0; i < works; ++i) free[i] = i;
  std::mutex mutex;  // guards free
  FirstFailure failure;
  const auto fetch = [&]() -> std::optional<std::size_t> {
    if (progress.isCancelled()) failure.note(Status::interrupted());
    if (failure.happened()) return std::nullopt;
    std::size_t work = 0;
    {
      const std::lock_guard lock(mutex);
      work = free.back();
      free.pop_back();
    }
    const Result<bool> has_one = source.fetch(work);
    failure.note(has_one.status());
    if (!has_one.ok() || !*has_one) return std::nullopt;
    return work;
  };
  const PipelineStage stages[] = {{PipelineStage::Mode::kParallel,
                                   [&](std::size_t work) {
                                     if (!failure.happened())
                                       failure.note(source.build(work, built[work]));
                                   }},
                                  {PipelineStage::Mode::kInOrder, [&](std::size_t work) {
                                     if (!failure.happened()) failure.note(take(built[work]));
                                     progress.advance(built[work].surfel_count);
                                     const std::lock_guard lock(mutex);
                                     free.push_back(work);
                                   }}};
  runPipeline(works, fetch, stages);
  return failure.status();
}

}  // namespace surfeit
