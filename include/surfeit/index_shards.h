// One scene indexed by many processes, on one machine or many, byte for byte as indexClouds does
// it.
//
// The shards of a job share the work of some passes. Each pass reads what the one before wrote, and
// every shard writes one file beside the scene ("out.sft.count-03-of-16"):
//
//   count        shard I reads the I-th part of the records: bounds, counts, a sample of places
//   distribute   reads the part again; sends its surfels to ranges of the curve, as many as shards
//   build        sorts the I-th range, and builds the pages and octrees of its slabs
//   places       (*) shard 1 writes a scene of the places alone, "out.sft.places"
//   sizes        (*) finds sizes and normals of the I-th range in it, and builds its slabs again
//   merge        one process writes the pages, and the top of the octree above them
//
// (*) where sizes or normals follow from neighbours; else both have nothing to do, and may be left
// out. docs/farm.md, "An index in shards", has the sizes of the files and the memory of each pass.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/index.h"
#include "surfeit/progress.h"
#include "surfeit/shards.h"
#include "surfeit/status.h"

namespace surfeit {

enum class IndexPass { kCount, kDistribute, kBuild, kPlaces, kSizes };

// The file of a shard.
SURFEIT_API std::string indexShardPath(const std::string& scene_path, IndexPass pass, int shard,
                                       int count);

struct IndexShardStats {
  int done_shards = 0;
  int finished_shards = 0;            // that were there already, and were skipped
  std::uint64_t memory_bytes = 0;     // the budget
  std::uint64_t records = 0;          // read by count and distribute
  std::uint64_t surfels = 0;          // counted, distributed, built or sized
  std::uint64_t file_bytes = 0;       // of the files of shards that were written
  std::uint64_t temporary_bytes = 0;  // most bytes of temporary files at any time
};

// One pass over shards of the job that indexClouds does with these arguments; `count` must be the
// same in all passes. A shard that is finished is read and checked, and skipped. Each appears
// whole, so that a job that was stopped goes on with those that are missing. Files depend on inputs
// and options that describe the scene; not on threads and memory. Where a far cloud asks for
// another origin than a sample of it did, distribute counts the records anew, about that origin.
// Errors: as indexClouds; kIncomplete, naming the shards of the pass before that are missing,
// damaged or of another job; kInvalidArgument for a range outside 1 to count, and for inputs that
// are streams. kBudgetTooSmall, too, where open blocks of all ranges do not fit.
SURFEIT_API Result<IndexShardStats> indexShards(const std::vector<std::string>& inputs,
                                                const std::string& output,
                                                const IndexOptions& options, IndexPass pass,
                                                const ShardRange& shards, Progress& progress);

// Writes the scene from the files of the build, or of the sizes. Where neighbours must agree on the
// sides of normals (NormalOrientation::Toward::kConsistent), that is done here, over the whole
// scene, which is then built anew by this process. `removes_shards`: the files of all passes go
// once it is complete. The statistics are those of indexClouds. Errors: as indexShards.
SURFEIT_API Result<IndexStats> mergeIndexShards(const std::vector<std::string>& inputs,
                                                const std::string& output,
                                                const IndexOptions& options, int count,
                                                bool removes_shards, Progress& progress);

// An estimate of what such a job needs: files, memory and time of its tasks.
struct IndexShardForecast {
  std::uint64_t records = 0, sampled_surfels = 0;
  std::uint64_t input_bytes = 0;
  std::uint64_t scene_bytes = 0;
  std::uint64_t shard_bytes = 0;   // of the files of all shards, beside the scene
  std::uint64_t memory_bytes = 0;  // that serves any task, the merge included
  double task_seconds = 0;         // the longest pass of a shard
  double merge_seconds = 0;        // of the longer of merge and places
  bool may_need_neighbours = false;
};

// Indexes a sample, as forecastIndex does, and applies the rules of docs/farm.md ("Memory and time
// of an index") to the result. Opens all inputs, and writes nothing that stays. `memory_bytes` of
// the options is that of the sample alone. Errors: as indexShards, for what it refuses before it
// reads.
SURFEIT_API Result<IndexShardForecast> forecastIndexShards(const std::vector<std::string>& inputs,
                                                           const std::string& output,
                                                           const IndexOptions& options, int count,
                                                           Progress& progress);

// Whether the passes `places` and `sizes` may have something to do, by the channels of the clouds
// and the options: a cloud without radii and areas, or with coverages, or normals that are asked
// for. Opens all inputs, and reads no surfel.
SURFEIT_API Result<bool> mayNeedNeighbours(const std::vector<std::string>& inputs,
                                           const IndexOptions& options);

}  // namespace surfeit
