// The pass `places` of an index in shards: a scene of the places alone, at full precision, as one
// machine makes it without a name. Searches for neighbours go through it (the pass `sizes`).
#pragma once

#include <cstdint>
#include <string>

#include "index/shards/index_shard_job.h"
#include "index/shards/index_shard_slabs.h"
#include "octree/read/scene_file.h"

namespace surfeit {

// What the file of the pass says.
struct ShardPlaces {
  bool has_scene = false;  // where no sizes and no normals follow from neighbours there is none
  BuiltShards built;
  std::uint64_t directory_checksum = 0;  // of the scene
};

std::string placesPath(const IndexShardJob& job);

// Shard 1 makes the scene, and a file that says what it is; the others have nothing to do. True
// when that was finished before.
Result<bool> makePlaces(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                        IndexShardStats& stats, Progress& progress);

// kIncomplete where the pass is not done; `next` is to be done behind it.
Result<ShardPlaces> readPlaces(const IndexShardJob& job, const IndexShardPlan& plan,
                               const std::string& next);
Result<SceneFile> openPlaces(const IndexShardJob& job, const ShardPlaces& places,
                             const std::string& next);
// Damage of the scene as what lacks; other failures pass.
Status damagedPlaces(const IndexShardJob& job, const std::string& next, const Status& status);

}  // namespace surfeit
