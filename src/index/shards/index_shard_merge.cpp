// The merge: slabs that were built elsewhere, stitched as one machine stitches its own.

#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/parallel.h"
#include "index/shards/index_shard_passes.h"
#include "index/shards/index_shard_places.h"
#include "index/shards/index_shard_slabs.h"
#include "index/steps/index_neighbours.h"
#include "index/steps/index_notes.h"
#include "index/steps/index_plan.h"
#include "index/steps/phase_clock.h"
#include "index/steps/scene_description.h"
#include "octree/build/octree_builder.h"
#include "octree/build/scene_writer.h"

namespace surfeit {
namespace {

// The scene of one job, from what the last pass has built.
class IndexMerge {
 public:
  IndexMerge(const IndexShardJob& job, const IndexShardPlan& plan, Progress& progress)
      : job_(job),
        plan_(plan),
        pass_(plan.needs_neighbours ? IndexPass::kSizes : IndexPass::kBuild),
        rule_(normalRule(job, plan)),
        description_(describe(job, plan, rule_)),
        progress_(progress),
        clock_(stats_) {}

  Result<IndexStats> run() {
    SURFEIT_RETURN_IF_ERROR(readFacts());
    const IndexOptions& options = job_.options;
    SURFEIT_ASSIGN_OR_RETURN(memory_, planMerge());
    noteIndexRules(plan_.totals, job_.reader, options, progress_);
    noteRepeats(stats_, options, progress_);
    if (progress_.isCancelled()) return Status::interrupted();

    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SceneWriter> writer,
                             createWriter(job_.output, options.full_precision));
    noteSceneName(job_.output, progress_);
    SURFEIT_RETURN_IF_ERROR(needsSides() ? mergeWithSides(*writer) : merge(*writer));
    if (plan_.needs_neighbours) noteThinSurfels(stats_, options, progress_);
    noteScatteredSurfels(stats_, progress_);
    SURFEIT_RETURN_IF_ERROR(writer->finish(description_.provenance()));
    clock_.finish("finish");
    takeStats(*writer);
    return stats_;
  }

 private:
  // Neighbours must agree on the sides of their normals, over the whole scene.
  bool needsSides() const { return rule_ && rule_->needsSides(); }
  bool fullPrecision() const {
    return plan_.needs_neighbours ? sizesAtFullPrecision(job_, plan_) : job_.options.full_precision;
  }

  // That all shards of the last pass are there.
  Status readFacts() {
    if (pass_ == IndexPass::kBuild) {
      SURFEIT_ASSIGN_OR_RETURN(const BuiltShards built,
                               readBuilds(job_, plan_, "merge", progress_));
      takeBuilt(built);
      return {};
    }
    SURFEIT_ASSIGN_OR_RETURN(const ShardPlaces places, readPlaces(job_, plan_, "merge"));
    takeBuilt(places.built);
    LackingShards lacking;
    std::uint64_t surfels = 0;
    for (int shard = 1; shard <= job_.count; ++shard) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(
          const auto reader,
          openShard(job_.path(pass_, shard), shard, expectedShard(job_, plan_, shard), lacking));
      if (!reader) continue;
      surfels += reader->facts().value("surfels", std::uint64_t{0});
      stats_.normals_found += reader->facts().value("normals_found", std::uint64_t{0});
      stats_.thin_surfels += reader->facts().value("thin_surfels", std::uint64_t{0});
      stats_.scattered_surfels += reader->facts().value("scattered_surfels", std::uint64_t{0});
    }
    SURFEIT_RETURN_IF_ERROR(lacking.status(job_, passName(pass_), "merge"));
    if (surfels == expected_) return {};
    return Status::failed(fmt::format("{}: sizes of {} surfels, expected {}: this is a bug",
                                      job_.output, surfels, expected_));
  }

  void takeBuilt(const BuiltShards& built) {
    stats_.repeated_surfels = built.repeated;
    expected_ = plan_.totals.surfels - built.left_out;
  }

  Result<IndexPlan> planMerge() const {
    IndexTask task;
    task.memory_bytes = job_.options.memory_bytes;
    task.threads = job_.options.threads;
    task.records = plan_.totals.surfels;
    task.slabs = {job_.options.leaf_capacity, fullPrecision()};
    if (needsSides()) task.search_bytes = leastNeighbourBytes(job_.options.normals, task.threads);
    return planIndex(task);
  }

  Result<std::unique_ptr<SceneWriter>> createWriter(const std::string& path,
                                                    bool full_precision) const {
    return SceneWriter::create(path, description_.header(full_precision),
                               description_.identity(full_precision));
  }

  Status checkCount(const SceneWriter& writer) const {
    if (writer.header().surfel_count == expected_) return {};
    return Status::failed(fmt::format("{}: {} surfels merged, expected {}: this is a bug",
                                      job_.output, writer.header().surfel_count, expected_));
  }

  Status merge(SceneWriter& writer) {
    progress_.beginPhase("merge", expected_, "surfels");
    StoredSlabs slabs(job_, plan_, pass_, "merge", memory_.slabs);
    SURFEIT_RETURN_IF_ERROR(stitchOctree(slabs, writer, memory_.slabs, progress_));
    SURFEIT_RETURN_IF_ERROR(checkCount(writer));
    clock_.finish("merge");
    return {};
  }

  // As one machine does it: a scene without a name, whose normals point to either side, then the
  // real one.
  Status mergeWithSides(SceneWriter& writer) {
    SURFEIT_ASSIGN_OR_RETURN(const auto unnamed,
                             createWriter(job_.temporary_directory + "/surfeit-octree.sft", true));
    SURFEIT_RETURN_IF_ERROR(merge(*unnamed));
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, unnamed->finishUnnamed(description_.provenance()));
    NeighbourBuild how;
    how.threads = job_.options.threads;
    how.memory_bytes = memory_.octree_memory;
    how.temporary_directory = job_.temporary_directory;
    how.up = job_.up();
    how.build = [&](SortedSurfelStream& stream) -> Status {
      progress_.beginPhase("build", expected_, "surfels");
      SURFEIT_RETURN_IF_ERROR(buildOctree(stream, writer, memory_.slabs, progress_));
      SURFEIT_RETURN_IF_ERROR(checkCount(writer));
      clock_.finish("build");
      return {};
    };
    return buildOriented(std::move(scene), how, stats_, clock_, progress_);
  }

  void takeStats(const SceneWriter& writer) {
    stats_.memory_bytes = job_.options.memory_bytes;
    stats_.input_bytes = job_.reader.fileBytes();
    stats_.surfels = writer.header().surfel_count;
    stats_.skipped_records = plan_.totals.skipped;
    stats_.nodes = writer.header().node_count;
    stats_.node_pages = writer.nodePages();
    stats_.surfel_pages = writer.surfelPages();
    stats_.file_bytes = writer.fileBytes();
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  const IndexPass pass_;  // whose slabs are merged
  const std::optional<NormalRule> rule_;
  const SceneDescription description_;
  Progress& progress_;
  IndexStats stats_;
  PhaseClock clock_;
  IndexPlan memory_;
  std::uint64_t expected_ = 0;  // surfels
};

void removeShards(const IndexShardJob& job, int rounds) {
  for (int shard = 1; shard <= job.count; ++shard) {
    for (int round = 1; round <= rounds; ++round) {
      unlink(job.path(IndexPass::kCount, shard, round).c_str());
    }
    unlink(job.path(IndexPass::kDistribute, shard).c_str());
    unlink(job.path(IndexPass::kBuild, shard).c_str());
    unlink(job.path(IndexPass::kSizes, shard).c_str());
  }
  unlink(job.path(IndexPass::kPlaces, 1).c_str());
  unlink(placesPath(job).c_str());
}

}  // namespace

Result<IndexStats> mergeIndexShards(const std::vector<std::string>& inputs,
                                    const std::string& output, const IndexOptions& options,
                                    int count, bool removes_shards, Progress& progress) {
  return guarded(output, [&]() -> Result<IndexStats> {
    if (count < 1 || count > kMostShards) {
      return Status::invalidArgument(
          fmt::format("{} shards, expected 1 to {}", count, kMostShards));
    }
    SURFEIT_ASSIGN_OR_RETURN(IndexShardJob job,
                             IndexShardJob::open(inputs, output, options, count, progress));
    Result<IndexStats> stats = Status::failed("merge: not run");
    withThreads(job.options.threads, [&] {
      stats = [&]() -> Result<IndexStats> {
        SURFEIT_ASSIGN_OR_RETURN(const IndexShardPlan plan, readPlan(job, "merge", progress));
        SURFEIT_ASSIGN_OR_RETURN(const IndexStats merged, IndexMerge(job, plan, progress).run());
        if (removes_shards) removeShards(job, plan.round);
        return merged;
      }();
    });
    return stats;
  });
}

}  // namespace surfeit
