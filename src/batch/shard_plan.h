// Where the shards of a job begin: pieces of the order that cost about the same, as the cuts of a
// sample of its receivers foresee it. No clock is asked, so that every process finds the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "batch/gather_input.h"
#include "batch/gather_job.h"
#include "batch/row_blocks.h"
#include "octree/read/scene_file.h"
#include "storage/external_sorter.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

struct ShardPlan {
  // Where a shard begins: so many valid receivers come before.
  struct Boundary {
    std::uint64_t rank = 0;
    OrderPlace place;
  };

  nlohmann::json job;  // identity that it belongs to
  std::uint64_t receivers_checksum = 0;
  std::uint64_t valid_receivers = 0, invalid_receivers = 0;
  std::vector<Boundary> boundaries;  // of all shards, and the end
  RowBlocks blocks;                  // of the receivers' rows; or none

  // Of shards first to last, from 1 on.
  OrderRange range(int first, int last) const {
    return {boundaries[static_cast<std::size_t>(first) - 1].place,
            boundaries[static_cast<std::size_t>(last)].place};
  }
  std::uint64_t bits(int first, int last) const {
    return shardBits(first, last, static_cast<int>(boundaries.size()) - 1);
  }
  std::uint64_t results(int shard) const {
    return boundaries[static_cast<std::size_t>(shard)].rank - firstRank(shard);
  }
  std::uint64_t firstRank(int shard) const {
    return boundaries[static_cast<std::size_t>(shard) - 1].rank;
  }
};

// Plans `count` shards of all receivers in `sorter` (finished), which it reads to the end. Shards
// are whole groups of GroupGatherer, so that what is gathered together does not depend on them;
// some are empty where there are fewer groups.
Result<ShardPlan> planShards(SceneFile scene, const GatherJob& job, ExternalSorter& sorter,
                             int count, Progress& progress);

// A plan as a file, which appears whole.
Status writeShardPlan(const std::string& path, const ShardPlan& plan);
// Nothing when there is no file, or none that is a plan of `count` shards; kIoError when it cannot
// be read.
Result<std::optional<ShardPlan>> readShardPlan(const std::string& path, int count);

}  // namespace surfeit
