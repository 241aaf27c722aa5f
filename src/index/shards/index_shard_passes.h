// The passes of an index in shards behind the count.
#pragma once

#include <cstdint>

#include "index/shards/index_shard_job.h"

namespace surfeit {

// True when the shard was finished before. The plan is that of the job.
Result<bool> distributeShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                             IndexShardStats& stats, Progress& progress);
Result<bool> buildShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                        IndexShardStats& stats, Progress& progress);
Result<bool> sizeShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                       IndexShardStats& stats, Progress& progress);

// Of what `sizes` writes: where neighbours must agree on sides, the merge works on it.
bool sizesAtFullPrecision(const IndexShardJob& job, const IndexShardPlan& plan);

// What the file of a shard says of its job.
nlohmann::json expectedShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard);

}  // namespace surfeit
