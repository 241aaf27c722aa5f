#include "surfeit/index_shards.h"

#include <fmt/format.h>

#include <optional>

#include "core/guard.h"
#include "core/parallel.h"
#include "index/shards/index_shard_job.h"
#include "index/shards/index_shard_passes.h"
#include "index/shards/index_shard_places.h"

namespace surfeit {
namespace {

// True when the shard was finished before. `plan` is read once, for all shards of the call.
Result<bool> runShard(IndexShardJob& job, IndexPass pass, int shard,
                      std::optional<IndexShardPlan>& plan, IndexShardStats& stats,
                      Progress& progress) {
  if (pass == IndexPass::kCount) return countShard(job, shard, stats, progress);
  if (!plan) {
    // Where bounds ask for another origin, the part is counted about that one here
    if (pass == IndexPass::kDistribute) {
      SURFEIT_RETURN_IF_ERROR(countShard(job, shard, stats, progress).status());
    }
    SURFEIT_ASSIGN_OR_RETURN(plan, readPlan(job, passName(pass), progress));
  }
  switch (pass) {
    case IndexPass::kDistribute:
      return distributeShard(job, *plan, shard, stats, progress);
    case IndexPass::kBuild:
      return buildShard(job, *plan, shard, stats, progress);
    case IndexPass::kPlaces:
      return makePlaces(job, *plan, shard, stats, progress);
    default:
      return sizeShard(job, *plan, shard, stats, progress);
  }
}

Result<IndexShardStats> runShards(IndexShardJob& job, IndexPass pass, const ShardRange& shards,
                                  Progress& progress) {
  IndexShardStats stats;
  stats.memory_bytes = job.options.memory_bytes;
  std::optional<IndexShardPlan> plan;
  for (int shard = shards.first; shard <= shards.last; ++shard) {
    SURFEIT_ASSIGN_OR_RETURN(const bool was_finished,
                             runShard(job, pass, shard, plan, stats, progress));
    ++(was_finished ? stats.finished_shards : stats.done_shards);
  }
  return stats;
}

}  // namespace

Result<IndexShardStats> indexShards(const std::vector<std::string>& inputs,
                                    const std::string& output, const IndexOptions& options,
                                    IndexPass pass, const ShardRange& shards, Progress& progress) {
  return guarded(output, [&]() -> Result<IndexShardStats> {
    if (shards.count < 1 || shards.count > kMostShards || shards.first < 1 ||
        shards.first > shards.last || shards.last > shards.count) {
      return Status::invalidArgument(
          fmt::format("shards {} to {} of {}, expected numbers from 1 to their count, at most {}",
                      shards.first, shards.last, shards.count, kMostShards));
    }
    SURFEIT_ASSIGN_OR_RETURN(IndexShardJob job,
                             IndexShardJob::open(inputs, output, options, shards.count, progress));
    Result<IndexShardStats> stats = Status::failed("index: not run");
    withThreads(job.options.threads, [&] { stats = runShards(job, pass, shards, progress); });
    return stats;
  });
}

}  // namespace surfeit
