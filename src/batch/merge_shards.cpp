// Brings the results of shards back into the order of the receivers, and writes these with them.

#include <fmt/format.h>

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "batch/gather_job.h"
#include "batch/gather_options.h"
#include "batch/job_identity.h"
#include "batch/result_store.h"
#include "batch/shard_file.h"
#include "batch/shard_names.h"
#include "core/guard.h"
#include "core/json_difference.h"
#include "core/number_ranges.h"
#include "storage/system_calls.h"
#include "surfeit/shards.h"

namespace surfeit {
namespace {

constexpr int kLeastRasterResolution = 2;  // of GatherQuality

class ShardMerge {
 public:
  ShardMerge(std::string result_path, int count, Progress& progress)
      : result_path_(std::move(result_path)), count_(count), progress_(progress) {}

  // Reads all headers. The job is that of most shards. Of each job one description is kept, for
  // there may be thousands of shards.
  Status readHeaders() {
    std::map<std::string, int> jobs;
    std::vector<std::optional<Piece>> pieces;
    for (int shard = 1; shard <= count_; ++shard) {
      if (progress_.isCancelled()) return Status::interrupted();
      Result<ShardReader> reader = ShardReader::open(shardPath(result_path_, shard, count_));
      if (reader.ok()) {
        const auto job = jobs.try_emplace(reader->header().job.dump(), 0).first;
        ++job->second;
        pieces.emplace_back(Piece{reader->header(), &job->first});
        pieces.back()->header.job = nullptr;
        continue;
      }
      pieces.emplace_back();
      lack(shard, access(shardPath(result_path_, shard, count_).c_str(), F_OK) == 0
                      ? reader.status().message()
                      : std::string());
    }
    int most = 0;
    const std::string* job = nullptr;
    for (const auto& piece : pieces) {
      if (!piece || jobs[*piece->job] <= most) continue;
      most = jobs[*piece->job];
      job = piece->job;
      first_ = piece->header;
    }
    if (most == 0) return incomplete();
    first_.job = nlohmann::json::parse(*job);
    checkTiling(pieces, job);
    return {};
  }

  const ShardHeader& job() const { return first_; }

  // kIncomplete unless all shards are there.
  Status incomplete() const {
    if (lacking_.empty()) return {};
    return Status::incomplete(fmt::format(
        "{}: shards {} of {} are missing{}; gather them by --shard (sbatch --array={}), then merge "
        "again",
        result_path_, numberRanges(lacking_), count_,
        reason_.empty() ? "" : fmt::format(" ({})", reason_), numberRanges(lacking_, ",")));
  }

  // Puts all results into the store.
  Status read(ResultStore& results, std::uint64_t receivers) {
    progress_.beginPhase("merge", first_.valid_receivers, "receivers");
    std::vector<ResultStore::Entry> entries;
    for (int shard = 1; shard <= count_; ++shard) {
      const Status status = readShard(shard, receivers, results, entries);
      if (status.code() == StatusCode::kCorruption) {
        lack(shard, status.message());
      } else if (!status.ok()) {
        return status;
      }
    }
    return incomplete();
  }

  void removeShards() const {
    for (int shard = 1; shard <= count_; ++shard) {
      system_calls::unlink(shardPath(result_path_, shard, count_).c_str());
    }
    system_calls::unlink(shardPlanPath(result_path_, count_).c_str());
  }

 private:
  struct Piece {
    ShardHeader header;      // without the job
    const std::string* job;  // equal for equal jobs
  };

  // Shards of the job follow each other without gap; those of another plan are to be gathered
  // again.
  void checkTiling(const std::vector<std::optional<Piece>>& pieces, const std::string* job) {
    std::uint64_t rank = 0;
    std::map<std::string, std::vector<int>> sets;
    for (int shard = 1; shard <= count_; ++shard) {
      const auto& piece = pieces[static_cast<std::size_t>(shard) - 1];
      if (!piece) {
        rank = kUnknown;
        continue;
      }
      const ShardHeader& header = piece->header;
      std::string difference;
      if (piece->job != job) {
        difference = differenceOf(nlohmann::json::parse(*piece->job), first_.job);
      }
      if (difference.empty() &&
          (header.receivers_checksum != first_.receivers_checksum ||
           header.valid_receivers != first_.valid_receivers || header.outputs != first_.outputs ||
           header.shard != shard || header.count != count_ ||
           (rank != kUnknown && header.first_rank != rank))) {
        difference = "gathered for other receivers";
      }
      if (!difference.empty()) {
        lack(shard, fmt::format("shard {} is of another job: {}", shard, difference));
        rank = kUnknown;
        continue;
      }
      sets[header.instruction_set].push_back(shard);
      rank = header.first_rank + header.results;
    }
    if (lacking_.empty() && rank != first_.valid_receivers) {
      lack(count_, "the last shard ends too early");
    }
    if (sets.size() > 1) noteInstructionSets(sets);
  }

  void noteInstructionSets(const std::map<std::string, std::vector<int>>& sets) {
    std::string text;
    for (const auto& [name, shards] : sets) {
      text += fmt::format("{}{}: shards {}", text.empty() ? "" : "; ", name, numberRanges(shards));
    }
    progress_.note(
        fmt::format("{}: gathered with several instruction sets, which agree within 1e-4, but not "
                    "bit for bit ({}); gather all shards on one kind of machine for equal bytes",
                    result_path_, text));
  }

  Status readShard(int shard, std::uint64_t receivers, ResultStore& results,
                   std::vector<ResultStore::Entry>& entries) {
    SURFEIT_ASSIGN_OR_RETURN(ShardReader reader,
                             ShardReader::open(shardPath(result_path_, shard, count_)));
    for (;;) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_RETURN_IF_ERROR(reader.next(entries));
      if (entries.empty()) return {};
      for (const ResultStore::Entry& entry : entries) {
        if (entry.index >= receivers) {
          return Status::corruption(fmt::format("{}: result of receiver {}, expected below {}",
                                                reader.path(), entry.index, receivers));
        }
      }
      SURFEIT_RETURN_IF_ERROR(results.put(entries));
      progress_.advance(entries.size());
    }
  }

  // The first reason is told.
  void lack(int shard, const std::string& reason) {
    lacking_.push_back(shard);
    if (reason_.empty()) reason_ = reason;
  }

  static constexpr std::uint64_t kUnknown = ~std::uint64_t{0};

  const std::string result_path_;
  const int count_;
  Progress& progress_;
  ShardHeader first_;  // of the job
  std::vector<int> lacking_;
  std::string reason_;
};

Result<int> countOf(const std::string& result_path, int given) {
  if (given < 0 || given > kMostShards) {
    return Status::invalidArgument(fmt::format("{} shards, expected 1 to {}", given, kMostShards));
  }
  if (given > 0) return given;
  SURFEIT_ASSIGN_OR_RETURN(const std::set<int> counts, shardCounts(result_path));
  if (counts.size() == 1) return *counts.begin();
  if (counts.empty()) {
    return Status::incomplete(fmt::format(
        "{}: found no shard of it, expected files {}", result_path,
        shardPath(result_path, 1, 1)
            .replace(result_path.size(), std::string::npos, ".shard-I-of-N beside it")));
  }
  std::vector<int> numbers(counts.begin(), counts.end());
  return Status::invalidArgument(
      fmt::format("{}: shards of several jobs, expected their number (--shards {})", result_path,
                  numberRanges(numbers, "|")));
}

Result<MergeStats> merge(const std::string& scene_path, const std::string& receivers_path,
                         const std::string& result_path, const MergeOptions& merging,
                         Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const int count, countOf(result_path, merging.count));
  ShardMerge shards(result_path, count, progress);
  SURFEIT_RETURN_IF_ERROR(shards.readHeaders());
  SURFEIT_ASSIGN_OR_RETURN(GatherOptions options, optionsOfJob(shards.job().job));
  static_cast<JobOptions&>(options) = merging;
  options = withDefaults(options);
  options.quality.raster_resolution = kLeastRasterResolution;  // nothing is gathered here
  options.prefetch = false;
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, openSceneBeside(scene_path, result_path));
  SURFEIT_ASSIGN_OR_RETURN(
      GatherJob job, GatherJob::openToMerge(receivers_path, result_path, options, scene, progress));
  for (const char* part : {"version", "scene", "receivers"}) {
    const std::string difference =
        differenceOf(jobIdentity(scene, job)[part], shards.job().job[part]);
    if (difference.empty()) continue;
    return Status::invalidArgument(fmt::format(
        "{}: the shards were gathered with another {}: {}; merge with that one, or gather again",
        result_path, part, difference));
  }
  SURFEIT_RETURN_IF_ERROR(shards.incomplete());

  const std::uint64_t receivers = job.input().receiverCount();
  SURFEIT_RETURN_IF_ERROR(job.createResult());
  ResultStore results(job.resultPlan());
  SURFEIT_RETURN_IF_ERROR(shards.read(results, receivers));
  SURFEIT_RETURN_IF_ERROR(job.write(results, shards.job().receivers_checksum));
  if (merging.removes_shards) shards.removeShards();
  return MergeStats{.shards = count,
                    .receivers = receivers,
                    .invalid_receivers = shards.job().invalid_receivers,
                    .memory_bytes = options.memory_bytes,
                    .temporary_bytes = results.temporaryBytes()};
}

}  // namespace

Result<MergeStats> mergeShards(const std::string& scene_path, const std::string& receivers_path,
                               const std::string& result_path, const MergeOptions& options,
                               Progress& progress) {
  return guarded(result_path,
                 [&] { return merge(scene_path, receivers_path, result_path, options, progress); });
}

}  // namespace surfeit
