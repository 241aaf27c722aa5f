// One gather by many processes, on one machine or many: each gathers some shards of the receivers,
// and a merge writes the result, byte for byte that of gatherCloud.
//
// The shards of a job divide its receivers, in the order in which they are gathered, into pieces of
// about equal cost. They are files beside the result: "out.ply.shard-03-of-16", and a small
// "out.ply.shards-of-16" that says where the pieces begin; the first process that needs it writes
// it. docs/farm.md.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/bake.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

inline constexpr int kMostShards = 10000;

// Shards first to last, both from 1 on and included, of `count` in all.
struct ShardRange {
  int first = 1, last = 1, count = 1;
};

struct ShardStats : GatherStats {
  int gathered_shards = 0;
  int finished_shards = 0;  // that were there already, and were skipped
};

// The file of a shard.
SURFEIT_API std::string shardPath(const std::string& result_path, int shard, int count);

// Gathers shards of the job that gatherCloud does with these arguments. A shard that is finished is
// read and checked, and skipped. Each appears whole, so that a job that was stopped goes on with
// those that are missing. Shards depend on the scene, the receivers and the options that decide
// about results; not on threads and memory. `receivers` and the rates of the statistics are of the
// shards that were gathered.
// Errors: as gatherCloud; kInvalidArgument for a range outside 1 to count, or a count outside 1 to
// kMostShards. kCorruption when the receivers change meanwhile.
SURFEIT_API Result<ShardStats> gatherShards(const std::string& scene_path,
                                            const std::string& receivers_path,
                                            const std::string& result_path,
                                            const GatherOptions& options, const ShardRange& shards,
                                            Progress& progress);

struct MergeOptions : JobOptions {
  int count = 0;                // number of shards; 0: of the job whose shards are there
  bool removes_shards = false;  // once the result is complete
};

struct MergeStats {
  int shards = 0;
  std::uint64_t receivers = 0, invalid_receivers = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t temporary_bytes = 0;
};

// Writes the result of a job from its shards, which say how its receivers are read. Checks that all
// shards are whole and of one job with this scene and these receivers.
// Errors: kIncomplete, naming the shards that are missing, damaged or of another job;
// kInvalidArgument without `count` where shards of several jobs are there; else as gatherCloud.
SURFEIT_API Result<MergeStats> mergeShards(const std::string& scene_path,
                                           const std::string& receivers_path,
                                           const std::string& result_path,
                                           const MergeOptions& options, Progress& progress);

// gatherCloud that goes on where it was stopped: gathers those of `count` shards that are missing,
// merges them and removes them. 0: up to 64, of 32,768 receivers or more. Errors: as gatherCloud.
SURFEIT_API Result<ShardStats> gatherResumable(const std::string& scene_path,
                                               const std::string& receivers_path,
                                               const std::string& result_path,
                                               const GatherOptions& options, int count,
                                               Progress& progress);

}  // namespace surfeit
