// The pass `sizes`: sizes and normals from neighbours, of the surfels that a shard has built. Its
// surfels are a run of pages of the scene of places; their neighbours may lie in any of its pages,
// a few beyond the run. What is found makes slabs again, which the merge stitches.

#include <memory>
#include <optional>

#include "index/shards/index_shard_passes.h"
#include "index/shards/index_shard_places.h"
#include "index/shards/index_shard_slabs.h"
#include "index/steps/index_neighbours.h"
#include "index/steps/index_plan.h"
#include "octree/build/octree_builder.h"
#include "octree/neighbours/local_density.h"
#include "octree/read/paged_octree.h"

namespace surfeit {
namespace {

class ShardSizes {
 public:
  ShardSizes(const IndexShardJob& job, const IndexShardPlan& plan, int shard, Progress& progress)
      : job_(job), plan_(plan), shard_(shard), progress_(progress) {}

  Status run(IndexShardStats& stats) {
    SURFEIT_ASSIGN_OR_RETURN(const ShardPlaces places, readPlaces(job_, plan_, kNext));
    nlohmann::json facts = expectedShard(job_, plan_, shard_);
    SURFEIT_ASSIGN_OR_RETURN(IndexShardWriter writer,
                             IndexShardWriter::create(job_.path(IndexPass::kSizes, shard_)));
    ShardSlabs slabs(writer);
    if (places.has_scene) {
      SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, openPlaces(job_, places, kNext));
      const BuiltRange& range = places.built.ranges[std::size_t(shard_) - 1];
      SURFEIT_RETURN_IF_ERROR(
          damagedPlaces(job_, kNext, build(std::move(scene), range, slabs, facts)));
    }
    slabs.addFacts(facts);
    facts["surfels"] = slabs.surfels();
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t bytes, writer.finish(facts));
    stats.surfels += slabs.surfels();
    stats.file_bytes += bytes;
    return {};
  }

 private:
  static constexpr const char* kNext = "sizes";

  Result<IndexPlan> planSizes(bool full_precision) const {
    IndexTask task;
    task.memory_bytes = job_.options.memory_bytes;
    task.threads = job_.options.threads;
    task.records = plan_.totals.surfels;  // of the directory
    task.slabs = {job_.options.leaf_capacity, full_precision};
    task.search_bytes = leastNeighbourBytes(std::nullopt, job_.options.threads);
    return planIndex(task);
  }

  Status build(SceneFile scene, const BuiltRange& range, ShardSlabs& slabs, nlohmann::json& facts) {
    if (range.begin_page >= range.end_page) return {};
    if (range.end_page > scene.surfelPageCount()) {
      return Status::corruption(scene.path() + ": fewer pages than were built");
    }
    const int threads = job_.options.threads;
    const std::optional<NormalRule> rule = normalRule(job_, plan_);
    const bool full_precision = sizesAtFullPrecision(job_, plan_);
    SURFEIT_ASSIGN_OR_RETURN(const IndexPlan memory, planSizes(full_precision));
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                             openNeighbours(std::move(scene), memory.octree_memory, threads,
                                            SizedSurfelStream::searcherBytes(threads)));
    SizedSurfelStream found(*octree, job_.options.disk_overlap, rule, threads, progress_);
    SURFEIT_RETURN_IF_ERROR(found.prepare());
    found.setPages(range.begin_page, range.end_page);
    CutSlabs cut(found, describe(job_, plan_, rule).header(full_precision), memory.slabs,
                 range.ends);
    progress_.beginPhase("sizes", plan_.totals.surfels / std::uint64_t(job_.count), "surfels");
    SURFEIT_RETURN_IF_ERROR(buildSlabs(
        cut, memory.slabs, [&](const BuiltSlab& slab) { return slabs.append(slab); }, progress_));
    facts["normals_found"] = found.normalsFound();
    facts["thin_surfels"] = found.thinSurfels();
    facts["scattered_surfels"] = found.scatteredSurfels();
    return {};
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  const int shard_;
  Progress& progress_;
};

}  // namespace

bool sizesAtFullPrecision(const IndexShardJob& job, const IndexShardPlan& plan) {
  const std::optional<NormalRule> rule = normalRule(job, plan);
  return job.options.full_precision || (rule && rule->needsSides());
}

Result<bool> sizeShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                       IndexShardStats& stats, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_finished, isFinished(job.path(IndexPass::kSizes, shard),
                                                              expectedShard(job, plan, shard),
                                                              /* checks= */ true, progress));
  if (is_finished) return true;
  SURFEIT_RETURN_IF_ERROR(ShardSizes(job, plan, shard, progress).run(stats));
  return false;
}

}  // namespace surfeit
