// The build: one range of the curve from all files of the distribution, sorted as one machine sorts
// its buckets, and cut into slabs. Ranges begin where slabs begin anew, so that these are the slabs
// of one machine.

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "core/thread_scratch.h"
#include "index/shards/index_shard_passes.h"
#include "index/shards/index_shard_pieces.h"
#include "index/shards/index_shard_slabs.h"
#include "index/steps/index_plan.h"
#include "index/steps/scene_description.h"
#include "octree/build/bucket_stream.h"
#include "octree/build/octree_builder.h"
#include "octree/build/surfel_store.h"
#include "octree/neighbours/repeated_surfels.h"

namespace surfeit {
namespace {

// Counts the surfels that a filter has left.
class CountedSurfels : public SortedSurfelStream {
 public:
  CountedSurfels(SortedSurfelStream& source, const std::vector<CurveKey>& splitters)
      : source_(source), counts_(splitters) {}

  Result<std::shared_ptr<const SortedBatch>> next() override {
    Result<std::shared_ptr<const SortedBatch>> batch = source_.next();
    if (!batch.ok() || *batch == nullptr) return batch;
    keys_.clear();
    for (const Ticket& ticket : (*batch)->tickets) keys_.push_back(ticket.key);
    counts_.add(std::span<const CurveKey>(keys_));
    return batch;
  }

  std::vector<std::uint64_t> counts() const {
    std::vector<std::uint64_t> counts;
    for (const RangeCount& count : counts_.counts()) counts.push_back(count.surfels);
    return counts;
  }

 private:
  SortedSurfelStream& source_;
  RangeCounts counts_;
  std::vector<CurveKey> keys_;
};

class ShardBuild {
 public:
  ShardBuild(const IndexShardJob& job, const IndexShardPlan& plan, int shard, Progress& progress)
      : job_(job), plan_(plan), shard_(shard), progress_(progress) {}

  Status run(IndexShardStats& stats) {
    SURFEIT_RETURN_IF_ERROR(findRange());
    nlohmann::json facts = expectedShard(job_, plan_, shard_);
    SURFEIT_ASSIGN_OR_RETURN(IndexShardWriter writer,
                             IndexShardWriter::create(job_.path(IndexPass::kBuild, shard_)));
    if (range_.surfels > 0) SURFEIT_RETURN_IF_ERROR(build(writer, facts, stats));
    facts["surfels"] = range_.surfels;
    facts["begins"] = begins_;
    facts["bytes"] = writer.payloadBytes();
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t bytes, writer.finish(facts));
    stats.surfels += range_.surfels;
    stats.file_bytes += bytes;
    return {};
  }

 private:
  // The range that begins with that of the shard; without surfels where another shard builds it.
  Status findRange() {
    RangeCounts counts(plan_.splitters);
    count_size_ = counts.counts().size();
    LackingShards lacking;
    for (int shard = 1; shard <= job_.count; ++shard) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const auto reader,
                               openShard(job_.path(IndexPass::kDistribute, shard), shard,
                                         expectedShard(job_, plan_, shard), lacking));
      if (!reader) continue;
      const Result<PieceTables> tables = readTables(*reader, plan_.rangeCount(), count_size_);
      if (!tables.ok()) {
        if (tables.status().code() != StatusCode::kCorruption) return tables.status();
        lacking.add(shard, tables.status().message());
        continue;
      }
      counts.add(std::span<const RangeCount>(tables->counts));
      bytes_ += reader->payloadBytes();
    }
    SURFEIT_RETURN_IF_ERROR(lacking.status(job_, "distribute", "build"));
    for (const RangeCounts::Joined& range : counts.join(leastBefore(job_.options.repeats))) {
      surfels_ += range.surfels;
      if (range.first != shard_ - 1) continue;
      range_ = range;
      begins_ = true;
    }
    if (surfels_ == plan_.totals.surfels) return {};
    return Status::failed(fmt::format("{}: {} surfels distributed, expected {}: this is a bug",
                                      job_.output, surfels_, plan_.totals.surfels));
  }

  // Neighbours are searched at the places as they are.
  bool fullPrecision() const { return job_.options.full_precision || plan_.needs_neighbours; }

  Result<IndexPlan> planBuild() const {
    const IndexOptions& options = job_.options;
    IndexTask task;
    task.memory_bytes = options.memory_bytes;
    task.threads = options.threads;
    task.records = range_.surfels;
    task.packed_bytes = double(bytes_) / double(surfels_);
    task.slabs = {options.leaf_capacity, fullPrecision()};
    task.filter_bytes = options.repeats == Repeats::kThin ? RepeatFilter::kBytesPerSurfel : 0;
    return planIndex(task);
  }

  // Words that divide the range into buckets, by the sample of all.
  std::vector<SortWord> bucketsOf(std::size_t count) const {
    const auto begin =
        range_.first == 0 ? CurveKey{0} : plan_.splitters[std::size_t(range_.first) - 1];
    const auto first = std::lower_bound(plan_.sample.begin(), plan_.sample.end(), begin);
    const auto last =
        std::size_t(range_.last) < plan_.splitters.size()
            ? std::lower_bound(first, plan_.sample.end(), plan_.splitters[std::size_t(range_.last)])
            : plan_.sample.end();
    const auto size = static_cast<std::size_t>(last - first);
    std::vector<SortWord> splitters;
    for (std::size_t b = 1; b < count && size > 0; ++b) {
      splitters.push_back(first[std::ptrdiff_t(size * b / count)]);
    }
    splitters.erase(std::unique(splitters.begin(), splitters.end()), splitters.end());
    return splitters;
  }

  Result<std::unique_ptr<SurfelStore>> readRange(const IndexPlan& plan) {
    SurfelStore::Plan store_plan;
    store_plan.splitters = bucketsOf(plan.bucket_count);
    store_plan.block_surfels = plan.block_surfels;
    store_plan.memory_bytes = plan.block_memory;
    store_plan.temporary_directory = job_.temporary_directory;
    auto store = std::make_unique<SurfelStore>(std::move(store_plan));
    const auto take = [&](std::span<const Surfel> surfels) -> Status {
      std::vector<CurveKey>& keys = threadScratch<std::vector<CurveKey>>([] {});
      keys.resize(surfels.size());
      if (!surfels.empty() && store->bucketCount() > 1) {
        curveKeys(&surfels.front().position, sizeof(Surfel), plan_.cube, keys);
      }
      return store->add(surfels, keys);
    };
    progress_.beginPhase("read", range_.surfels, "surfels");
    for (int shard = 1; shard <= job_.count; ++shard) {
      SURFEIT_RETURN_IF_ERROR(readShard(shard, plan.read_bytes, take));
    }
    SURFEIT_RETURN_IF_ERROR(store->finish());
    return store;
  }

  Status readShard(int shard, std::size_t read_bytes, const SurfelTaker& take) {
    LackingShards lacking;
    SURFEIT_ASSIGN_OR_RETURN(const auto reader,
                             openShard(job_.path(IndexPass::kDistribute, shard), shard,
                                       expectedShard(job_, plan_, shard), lacking));
    SURFEIT_RETURN_IF_ERROR(lacking.status(job_, "distribute", "build"));
    SURFEIT_ASSIGN_OR_RETURN(const PieceTables tables,
                             readTables(*reader, plan_.rangeCount(), count_size_));
    for (int range = range_.first; range <= range_.last; ++range) {
      const Status status =
          readPiece(*reader, tables.pieces[std::size_t(range)], read_bytes, take, progress_);
      if (status.code() != StatusCode::kCorruption) {
        SURFEIT_RETURN_IF_ERROR(status);
        continue;
      }
      lacking.add(shard, status.message());
      return lacking.status(job_, "distribute", "build");
    }
    return {};
  }

  Status build(IndexShardWriter& writer, nlohmann::json& facts, IndexShardStats& stats) {
    SURFEIT_ASSIGN_OR_RETURN(const IndexPlan plan, planBuild());
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<SurfelStore> store, readRange(plan));
    BucketStream buckets(std::move(store),
                         BucketStream::Options{plan_.cube, plan.bucket_capacity, plan.spare_memory,
                                               job_.temporary_directory},
                         progress_);
    RepeatFilter distinct(buckets, job_.options.repeats);
    const std::optional<NormalRule> rule = normalRule(job_, plan_);
    const SceneDescription description = describe(job_, plan_, rule);
    CountedSurfels left(distinct, plan_.splitters);
    const bool is_thin = job_.options.repeats == Repeats::kThin;
    SortedSurfelStream& stream = is_thin ? static_cast<SortedSurfelStream&>(left) : distinct;
    CutSlabs cut(stream, description.header(fullPrecision()), plan.slabs, range_.ends);
    ShardSlabs slabs(writer);
    progress_.beginPhase("build", range_.surfels, "surfels");
    SURFEIT_RETURN_IF_ERROR(buildSlabs(
        cut, plan.slabs, [&](const BuiltSlab& slab) { return slabs.append(slab); }, progress_));
    if (slabs.surfels() + distinct.leftOut() != range_.surfels) {
      return Status::failed(fmt::format("{}: {} surfels built, expected {}: this is a bug",
                                        job_.output, slabs.surfels(), range_.surfels));
    }
    slabs.addFacts(facts);
    facts["begin_level"] = range_.ends.begin_level;
    facts["end_level"] = range_.ends.end_level;
    if (is_thin) facts["left"] = left.counts();
    facts["repeated"] = distinct.repeated();
    facts["left_out"] = distinct.leftOut();
    stats.temporary_bytes = std::max(stats.temporary_bytes, buckets.temporaryBytes());
    return {};
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  const int shard_;
  Progress& progress_;
  RangeCounts::Joined range_;
  bool begins_ = false;         // a range that is built together begins with that of the shard
  std::size_t count_size_ = 0;  // of the counts of a file
  std::uint64_t surfels_ = 0, bytes_ = 0;  // of all shards
};

}  // namespace

Result<bool> buildShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                        IndexShardStats& stats, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_finished, isFinished(job.path(IndexPass::kBuild, shard),
                                                              expectedShard(job, plan, shard),
                                                              /* checks= */ true, progress));
  if (is_finished) return true;
  SURFEIT_RETURN_IF_ERROR(ShardBuild(job, plan, shard, progress).run(stats));
  return false;
}

}  // namespace surfeit
