// A shard is a range of the order. Whoever gathers one reads all receivers, and sorts those of its
// range:
//
//   plan (once, by the first): rows --sort--> order --cost of a sample--> where shards begin
//   shard:  rows --those of the range--> sort --gather--> file of results
//   merge:  files --by index--> rows (merge_shards.cpp)

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "batch/gather_crew.h"
#include "batch/gather_job.h"
#include "batch/gather_options.h"
#include "batch/job_identity.h"
#include "batch/shard_file.h"
#include "batch/shard_names.h"
#include "batch/shard_plan.h"
#include "core/guard.h"
#include "core/json_difference.h"
#include "gather/packet/packet_kernel.h"
#include "storage/output_target.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

class ShardGather {
 public:
  ShardGather(GatherJob job, const SceneFile& scene, std::string result_path,
              const ShardRange& shards, Progress& progress)
      : job_(std::move(job)),
        identity_(jobIdentity(scene, job_)),
        result_path_(std::move(result_path)),
        shards_(shards),
        progress_(progress) {}

  Result<ShardStats> run(SceneFile scene) {
    SURFEIT_RETURN_IF_ERROR(job_.note(scene));
    SURFEIT_RETURN_IF_ERROR(checkOutputRoom(shardPlanPath(result_path_, shards_.count), 0));
    SURFEIT_RETURN_IF_ERROR(prepare(scene));
    ShardStats stats;
    static_cast<GatherStats&>(stats) = job_.stats();
    stats.invalid_receivers = 0;
    stats.receivers = 0;
    for (const int shard : missing_) stats.receivers += plan_.results(shard);
    stats.gathered_shards = static_cast<int>(missing_.size());
    stats.finished_shards = shards_.last - shards_.first + 1 - stats.gathered_shards;
    if (!missing_.empty()) SURFEIT_RETURN_IF_ERROR(gather(std::move(scene), stats));
    stats.temporary_bytes = sorter_->temporaryBytes();
    return stats;
  }

 private:
  // Finds the plan, the shards that are missing, and their receivers. A plan for other receivers,
  // which shows when all are read, is made anew.
  Status prepare(const SceneFile& scene) {
    const std::string path = shardPlanPath(result_path_, shards_.count);
    SURFEIT_ASSIGN_OR_RETURN(std::optional<ShardPlan> plan, readShardPlan(path, shards_.count));
    for (bool is_new = false;; is_new = true) {
      if (!plan || plan->job != identity_) {
        SURFEIT_ASSIGN_OR_RETURN(plan, makePlan(scene));
        SURFEIT_RETURN_IF_ERROR(writeShardPlan(path, *plan));
        is_new = true;
      }
      plan_ = std::move(*plan);
      SURFEIT_RETURN_IF_ERROR(findMissing());
      if (sorter_ != nullptr) return {};
      const OrderRange range = missing_.empty() ? OrderRange{OrderRange::kEnd, OrderRange::kEnd}
                                                : plan_.range(missing_.front(), missing_.back());
      // What is strict looks at all rows
      const RowBlocks* const blocks =
          plan_.blocks.shards.empty() || job_.options().strict ? nullptr : &plan_.blocks;
      SURFEIT_ASSIGN_OR_RETURN(sorter_, job_.sort(scene.header(), range, blocks,
                                                  plan_.bits(shards_.first, shards_.last)));
      if (blocks != nullptr && !is_new && plan_.invalid_receivers > 0) {
        progress_.note(fmt::format("{}: no result (NaN) at invalid receivers: {}",
                                   job_.input().reader().path(), plan_.invalid_receivers));
      }
      if (job_.input().checksum() == plan_.receivers_checksum) return {};
      if (is_new) {
        return Status::corruption(
            fmt::format("{}: changed while it was read", job_.input().reader().path()));
      }
      plan.reset();
      sorter_.reset();
    }
  }

  // Keeps the sorted receivers where all of them are to be gathered.
  Result<ShardPlan> makePlan(const SceneFile& scene) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<ExternalSorter> sorter, job_.sort(scene.header()));
    const bool takes_all = shards_.first == 1 && shards_.last == shards_.count;
    std::optional<ExternalSorter::Mark> begin;
    if (takes_all) begin = sorter->mark();
    SURFEIT_ASSIGN_OR_RETURN(SceneFile again,
                             SceneFile::open(scene.path(), sceneAccess(job_.options())));
    again.stageAs(scene);
    SURFEIT_ASSIGN_OR_RETURN(ShardPlan plan,
                             planShards(std::move(again), job_, *sorter, shards_.count, progress_));
    plan.job = identity_;
    if (begin) {
      SURFEIT_RETURN_IF_ERROR(sorter->reset(*begin));
      sorter_ = std::move(sorter);
      sorted_from_ = 1;
    }
    return plan;
  }

  Status findMissing() {
    missing_.clear();
    for (int shard = shards_.first; shard <= shards_.last; ++shard) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const bool is_finished, isFinished(shard));
      if (!is_finished) missing_.push_back(shard);
    }
    if (sorter_ == nullptr && !missing_.empty()) sorted_from_ = missing_.front();
    return {};
  }

  // Whether the shard is there, whole, and of this job; says why not.
  Result<bool> isFinished(int shard) {
    const std::string path = shardPath(result_path_, shard, shards_.count);
    Result<ShardReader> reader = ShardReader::open(path);
    if (!reader.ok()) {
      if (reader.status().code() == StatusCode::kCorruption) {
        progress_.inform(reader.status().message() + "; gathered again");
      }
      return false;  // what cannot be opened shows when it is written
    }
    const ShardHeader& header = reader->header();
    std::string difference = differenceOf(header.job, identity_);
    if (difference.empty() &&
        (header.receivers_checksum != plan_.receivers_checksum ||
         header.first_rank != plan_.firstRank(shard) || header.results != plan_.results(shard))) {
      difference = "the receivers have changed";
    }
    if (!difference.empty()) {
      progress_.inform(fmt::format("{}: of another job: {}; gathered again", path, difference));
      return false;
    }
    const Status checked = reader->check();
    if (!checked.ok()) progress_.inform(checked.message() + "; gathered again");
    return checked.ok();
  }

  Status gather(SceneFile scene, ShardStats& stats) {
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<SortedGather> gather,
                             SortedGather::create(std::move(scene), job_.memory(), job_.options(),
                                                  stats, progress_, job_.environment()));
    int shard = sorted_from_;
    for (const int wanted : missing_) {
      for (; shard < wanted; ++shard) SURFEIT_RETURN_IF_ERROR(skip(plan_.results(shard)));
      SURFEIT_RETURN_IF_ERROR(gatherShard(*gather, shard++));
    }
    gather->finish();
    return {};
  }

  Status gatherShard(SortedGather& gather, int shard) {
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<ShardWriter> writer,
                             ShardWriter::create(shardPath(result_path_, shard, shards_.count),
                                                 {.job = identity_,
                                                  .receivers_checksum = plan_.receivers_checksum,
                                                  .instruction_set = fastestPacketKernel().name,
                                                  .outputs = job_.options().outputs,
                                                  .shard = shard,
                                                  .count = shards_.count,
                                                  .first_rank = plan_.firstRank(shard),
                                                  .results = plan_.results(shard),
                                                  .valid_receivers = plan_.valid_receivers,
                                                  .invalid_receivers = plan_.invalid_receivers}));
    SURFEIT_RETURN_IF_ERROR(gather.gather(
        *sorter_, [&](std::span<const ResultStore::Entry> entries) { return writer->put(entries); },
        plan_.results(shard)));
    return writer->finish();
  }

  Status skip(std::uint64_t receivers) {
    ReceiverQueue queue(*sorter_, kQueueReceivers, receivers);
    std::vector<SortedReceiver> run;
    do {
      SURFEIT_RETURN_IF_ERROR(queue.take(run, kQueueReceivers));
    } while (!run.empty());
    return {};
  }

  GatherJob job_;
  const nlohmann::json identity_;
  const std::string result_path_;
  const ShardRange shards_;
  Progress& progress_;
  ShardPlan plan_;
  std::vector<int> missing_;
  std::unique_ptr<ExternalSorter> sorter_;
  int sorted_from_ = 1;  // first shard whose receivers are in it
};

Status checkShards(const std::string& result_path, const ShardRange& shards) {
  if (shards.count < 1 || shards.count > kMostShards || shards.first < 1 ||
      shards.first > shards.last || shards.last > shards.count) {
    return Status::invalidArgument(
        fmt::format("shards {} to {} of {}, expected numbers from 1 to their count, at most {}",
                    shards.first, shards.last, shards.count, kMostShards));
  }
  SURFEIT_ASSIGN_OR_RETURN(const OutputTarget target, resolveOutput(result_path));
  if (target.is_stream) {
    return Status::invalidArgument(fmt::format(
        "{}: shards stand beside the result, expected the name of a file", result_path));
  }
  return {};
}

// Of a job that may be stopped: no more than a 64th of its work is lost, and each shard is long
// enough for all threads to work at.
constexpr std::uint64_t kMostResumed = 64, kLeastResumedReceivers = 32768;

Result<int> resumedShards(const std::string& receivers_path, const GatherOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(
      const GatherInput input,
      GatherInput::open(receivers_path, options.channels, options.part, options.filter));
  return static_cast<int>(
      std::clamp<std::uint64_t>(input.receiverCount() / kLeastResumedReceivers, 1, kMostResumed));
}

}  // namespace

Result<ShardStats> gatherShards(const std::string& scene_path, const std::string& receivers_path,
                                const std::string& result_path, const GatherOptions& given,
                                const ShardRange& shards, Progress& progress) {
  return guarded(result_path, [&]() -> Result<ShardStats> {
    SURFEIT_RETURN_IF_ERROR(checkShards(result_path, shards));
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene,
                             openSceneFor(scene_path, result_path, given, progress));
    SURFEIT_ASSIGN_OR_RETURN(GatherJob job, GatherJob::open(receivers_path, result_path,
                                                            withDefaults(given), scene, progress));
    ShardGather gather(std::move(job), scene, result_path, shards, progress);
    return gather.run(std::move(scene));
  });
}

Result<ShardStats> gatherResumable(const std::string& scene_path, const std::string& receivers_path,
                                   const std::string& result_path, const GatherOptions& options,
                                   int count, Progress& progress) {
  if (count == 0) {
    SURFEIT_ASSIGN_OR_RETURN(count, resumedShards(receivers_path, options));
  }
  SURFEIT_ASSIGN_OR_RETURN(ShardStats stats, gatherShards(scene_path, receivers_path, result_path,
                                                          options, {1, count, count}, progress));
  MergeOptions merging{static_cast<const JobOptions&>(options)};
  merging.count = count;
  merging.removes_shards = true;
  SURFEIT_ASSIGN_OR_RETURN(const MergeStats merged,
                           mergeShards(scene_path, receivers_path, result_path, merging, progress));
  stats.invalid_receivers = merged.invalid_receivers;
  stats.temporary_bytes += merged.temporary_bytes;
  return stats;
}

}  // namespace surfeit
