// Slabs in the files of shards: what the passes `build` and `sizes` write, and what those read that
// stitch them.
//
//   payload: [ bytes, checksum : 16 | slab ], slab after slab
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "index/shards/index_shard_file.h"
#include "index/shards/index_shard_job.h"
#include "octree/build/slab_source.h"

namespace surfeit {

// Appends slabs to the file of a shard.
class ShardSlabs {
 public:
  explicit ShardSlabs(IndexShardWriter& writer) : writer_(writer) {}

  Status append(const BuiltSlab& slab);
  std::uint64_t surfels() const { return surfels_; }
  // "slabs" and "pages", those of surfels.
  void addFacts(nlohmann::json& facts) const;

 private:
  IndexShardWriter& writer_;
  std::uint64_t surfels_ = 0, slabs_ = 0, pages_ = 0;
  std::vector<std::byte> bytes_;
};

// The slabs of all shards of a pass, in order. Damage is kIncomplete, with what is to be done again
// and then `next`.
class StoredSlabs : public SlabSource {
 public:
  StoredSlabs(const IndexShardJob& job, const IndexShardPlan& plan, IndexPass pass,
              std::string next, std::size_t works)
      : job_(job), plan_(plan), pass_(pass), next_(std::move(next)), stored_(works) {}

  Result<bool> fetch(std::size_t work) override;
  Status build(std::size_t work, BuiltSlab& built) override;

 private:
  struct Stored {
    std::vector<std::byte> bytes;
    std::uint64_t checksum = 0;
    int shard = 0;
  };

  Status openNext();
  Status damaged(int shard, const Status& status) const;

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  const IndexPass pass_;
  const std::string next_;
  std::vector<Stored> stored_;
  std::optional<IndexShardReader> reader_;
  int shard_ = 0;  // being read
  std::uint64_t offset_ = 0;
};

// What a shard has built, as pages of the scene that its slabs are stitched to.
struct BuiltRange {
  std::uint32_t begin_page = 0, end_page = 0;
  StreamEnds ends;
};

// What all builds together say.
struct BuiltShards {
  std::uint64_t repeated = 0, left_out = 0;
  std::vector<BuiltRange> ranges;  // by shard
};

// kIncomplete unless all builds are there; kInvalidArgument where surfels that were left out make a
// range begin within a brick.
Result<BuiltShards> readBuilds(const IndexShardJob& job, const IndexShardPlan& plan,
                               const std::string& next, Progress& progress);

}  // namespace surfeit
