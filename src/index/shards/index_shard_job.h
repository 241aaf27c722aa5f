// What all passes of an index in shards share: inputs, identity, and the plan that follows from the
// counts of all shards.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/curve_key.h"
#include "index/shards/index_shard_file.h"
#include "index/shards/index_shard_ranges.h"
#include "index/steps/cloud_reader.h"
#include "index/steps/group_plan.h"
#include "index/steps/scene_description.h"
#include "octree/neighbours/normal_rule.h"
#include "surfeit/index.h"
#include "surfeit/index_shards.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A job with its inputs open. What is read of them is counted from the origin of the reader.
struct IndexShardJob {
  GroupPlan groups;
  GroupNames group_names;
  std::string output;
  IndexOptions options;  // with memory and threads set
  int count = 1;         // shards
  CloudReader reader;
  glm::dvec3 first_origin{0};  // by a sample
  nlohmann::json identity;     // of inputs and options: files of one job have it
  std::string temporary_directory;

  static Result<IndexShardJob> open(const std::vector<std::string>& inputs,
                                    const std::string& output, const IndexOptions& options,
                                    int count, Progress& progress);

  // By the channels of the clouds. What their surfels lack, the counts tell.
  bool mayNeedNeighbours() const { return reader.lacksSizes() || options.normals.has_value(); }
  UpAxis up() const { return options.up.value_or(reader.up()); }
  // The records of a shard.
  CloudReader::Records recordsOf(int shard) const;
  std::string path(IndexPass pass, int shard, int round = 1) const {
    return indexShardPath(output, pass, shard, count, round);
  }
};

// What all counts together say.
struct IndexShardPlan {
  CloudTotals totals;  // its sample: places alone
  glm::dvec3 origin{0};
  RootCube cube;
  std::vector<CurveKey> sample;     // rising
  std::vector<CurveKey> splitters;  // where ranges begin
  std::string identity;             // files of one plan have it
  int round = 1;                    // of the counts
  bool needs_neighbours = false;    // sizes or normals follow from neighbours

  std::size_t rangeCount() const { return splitters.size() + 1; }
};

// Makes the plan from the files of the counts, and counts positions from its origin from now on.
// kIncomplete where some are missing; `next` is what is to be done once they are there.
Result<IndexShardPlan> readPlan(IndexShardJob& job, const std::string& next, Progress& progress);

// The rule by which normals are found; absent where no surfel asks for it.
std::optional<NormalRule> normalRule(const IndexShardJob& job, const IndexShardPlan& plan);
// Of the scene. All of it must stay where it is.
SceneDescription describe(const IndexShardJob& job, const IndexShardPlan& plan,
                          const std::optional<NormalRule>& rule);

// Counts a shard, about every origin that the counts so far ask for, unless it is counted. True
// when it was counted before.
Result<bool> countShard(IndexShardJob& job, int shard, IndexShardStats& stats, Progress& progress);

// The totals of a shard from the facts of its count, without sample; false when these are none.
bool totalsOf(const nlohmann::json& facts, CloudTotals& totals);

// The file of a shard if it is whole and its facts `name`, `value` are as expected; says why not.
// `checks` reads it all.
Result<bool> isFinished(const std::string& path, const nlohmann::json& expected, bool checks,
                        Progress& progress);

// Shards that lack, and why the first one does.
class LackingShards {
 public:
  void add(int shard, const std::string& reason);
  bool isEmpty() const { return shards_.empty(); }
  // kIncomplete that names them, unless there are none. `pass` as on the command line.
  Status status(const IndexShardJob& job, const char* pass, const std::string& next) const;

 private:
  std::vector<int> shards_;
  std::string reason_;
};

// Opens the file of a shard for its reader, and checks that its facts are as expected; else the
// shard lacks, and nothing is returned. Other failures than damage and absence are returned.
Result<std::optional<IndexShardReader>> openShard(const std::string& path, int shard,
                                                  const nlohmann::json& expected,
                                                  LackingShards& lacking);

}  // namespace surfeit
