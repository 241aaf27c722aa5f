// The merge: slabs that were built elsewhere, stitched as one machine stitches its own.

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/parallel.h"
#include "index/index_notes.h"
#include "index/index_plan.h"
#include "index/index_shard_passes.h"
#include "index/phase_clock.h"
#include "index/scene_description.h"
#include "octree/build/built_slab_bytes.h"
#include "octree/build/octree_builder.h"
#include "octree/build/scene_writer.h"
#include "octree/neighbours/repeated_surfels.h"

namespace surfeit {
namespace {

// No slab takes more: a claim of more is damage.
constexpr std::uint64_t kMostSlabBytes = 512 << 20;

// The slabs of all builds, in order.
class StoredSlabs : public SlabSource {
 public:
  StoredSlabs(const IndexShardJob& job, const IndexShardPlan& plan, std::size_t works)
      : job_(job), plan_(plan), stored_(works) {}

  Result<bool> fetch(std::size_t work) override {
    while (!reader_ || offset_ == reader_->payloadBytes()) {
      if (shard_ == job_.count) return false;
      SURFEIT_RETURN_IF_ERROR(openNext());
    }
    Stored& stored = stored_[work];
    std::uint64_t head[2] = {};
    Status status = reader_->readAt(offset_, std::as_writable_bytes(std::span(head)));
    if (status.ok() &&
        (head[0] > kMostSlabBytes || head[0] > reader_->payloadBytes() - offset_ - sizeof head)) {
      status = Status::corruption(
          fmt::format("{}: slab at {}: {} bytes", reader_->path(), offset_, head[0]));
    }
    if (!status.ok()) return damaged(shard_, status);
    stored.bytes.resize(static_cast<std::size_t>(head[0]));
    status = reader_->readAt(offset_ + sizeof head, stored.bytes);
    if (!status.ok()) return damaged(shard_, status);
    stored.shard = shard_;
    stored.checksum = head[1];
    offset_ += sizeof head + head[0];
    return true;
  }

  Status build(std::size_t work, BuiltSlab& built) override {
    const Stored& stored = stored_[work];
    if (checksumOf(stored.bytes) != stored.checksum) {
      return damaged(stored.shard,
                     Status::corruption(fmt::format("{}: a slab does not fit its checksum",
                                                    job_.path(IndexPass::kBuild, stored.shard))));
    }
    const Status status = decodeBuiltSlab(stored.bytes, built);
    return status.ok() ? status : damaged(stored.shard, status);
  }

 private:
  struct Stored {
    std::vector<std::byte> bytes;
    std::uint64_t checksum = 0;
    int shard = 0;
  };

  Status openNext() {
    ++shard_;
    offset_ = 0;
    LackingShards lacking;
    SURFEIT_ASSIGN_OR_RETURN(reader_, openShard(job_.path(IndexPass::kBuild, shard_), shard_,
                                                expectedShard(job_, plan_, shard_), lacking));
    return lacking.status(job_, "build", "merge");
  }

  // Damage is named as what lacks; other failures pass.
  Status damaged(int shard, const Status& status) const {
    if (status.code() != StatusCode::kCorruption) return status;
    LackingShards lacking;
    lacking.add(shard, status.message());
    return lacking.status(job_, "build", "merge");
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  std::vector<Stored> stored_;
  std::optional<IndexShardReader> reader_;
  int shard_ = 0;  // being read
  std::uint64_t offset_ = 0;
};

class IndexMerge {
 public:
  IndexMerge(const IndexShardJob& job, const IndexShardPlan& plan, Progress& progress)
      : job_(job), plan_(plan), progress_(progress), clock_(stats_), left_(plan.splitters) {}

  Result<IndexStats> run() {
    SURFEIT_RETURN_IF_ERROR(readFacts());
    const IndexOptions& options = job_.options;
    IndexTask task;
    task.memory_bytes = options.memory_bytes;
    task.threads = options.threads;
    task.records = plan_.totals.surfels;
    task.slabs = {options.leaf_capacity, options.full_precision};
    SURFEIT_ASSIGN_OR_RETURN(const IndexPlan memory, planIndex(task));
    noteIndexRules(plan_.totals, job_.reader, options, progress_);
    noteRepeats(stats_, options, progress_);
    if (progress_.isCancelled()) return Status::interrupted();

    const SceneDescription description{options,   job_.group_names, plan_.totals,     plan_.origin,
                                       job_.up(), nullptr,          job_.reader.crs()};
    SURFEIT_ASSIGN_OR_RETURN(
        const std::unique_ptr<SceneWriter> writer,
        SceneWriter::create(job_.output, description.header(options.full_precision),
                            description.identity(options.full_precision)));
    noteSceneName(job_.output, progress_);
    progress_.beginPhase("merge", expected(), "surfels");
    StoredSlabs slabs(job_, plan_, memory.slabs);
    SURFEIT_RETURN_IF_ERROR(stitchOctree(slabs, *writer, memory.slabs, progress_));
    if (writer->header().surfel_count != expected()) {
      return Status::failed(fmt::format("{}: {} surfels merged, expected {}: this is a bug",
                                        job_.output, writer->header().surfel_count, expected()));
    }
    clock_.finish("merge");
    SURFEIT_RETURN_IF_ERROR(writer->finish(description.provenance()));
    clock_.finish("finish");
    takeStats(*writer);
    return stats_;
  }

 private:
  std::uint64_t expected() const { return plan_.totals.surfels - left_out_; }

  // That all builds are there.
  Status readFacts() {
    LackingShards lacking;
    std::uint64_t surfels = 0;
    for (int shard = 1; shard <= job_.count; ++shard) {
      if (progress_.isCancelled()) return Status::interrupted();
      SURFEIT_ASSIGN_OR_RETURN(const auto reader,
                               openShard(job_.path(IndexPass::kBuild, shard), shard,
                                         expectedShard(job_, plan_, shard), lacking));
      if (!reader) continue;
      const nlohmann::json& facts = reader->facts();
      surfels += facts.value("surfels", std::uint64_t{0});
      left_out_ += facts.value("left_out", std::uint64_t{0});
      if (shard > 1 && facts.value("begins", false)) begins_.push_back(std::size_t(shard) - 1);
      addLeft(facts);
      stats_.repeated_surfels += facts.value("repeated", std::uint64_t{0});
    }
    SURFEIT_RETURN_IF_ERROR(lacking.status(job_, "build", "merge"));
    if (surfels == plan_.totals.surfels) return checkLeft();
    return Status::failed(fmt::format("{}: {} surfels built, expected {}: this is a bug",
                                      job_.output, surfels, plan_.totals.surfels));
  }

  // Surfels that are left where repeated ones are left out.
  void addLeft(const nlohmann::json& facts) {
    const auto left = facts.value("left", std::vector<std::uint64_t>());
    if (left.size() != left_.counts().size()) return;
    std::vector<RangeCount> counts(left.size());
    for (std::size_t i = 0; i < left.size(); ++i) counts[i].surfels = left[i];
    left_.add(std::span<const RangeCount>(counts));
  }

  // That no range begins within a brick.
  Status checkLeft() const {
    if (job_.options.repeats != Repeats::kThin) return {};
    for (const std::size_t range : begins_) {
      if (left_.hasBefore(range, kBrickSurfels)) continue;
      return Status::invalidArgument(fmt::format(
          "{}: so many surfels repeat others that the curve cannot be cut before shard {}: index "
          "with fewer shards than {}, or on one machine",
          job_.output, range + 1, job_.count));
    }
    return {};
  }

  void takeStats(const SceneWriter& writer) {
    stats_.memory_bytes = job_.options.memory_bytes;
    stats_.input_bytes = job_.reader.fileBytes();
    stats_.surfels = writer.header().surfel_count;
    stats_.skipped_records = plan_.totals.skipped;
    stats_.nodes = writer.header().node_count;
    stats_.node_pages = writer.nodePages();
    stats_.surfel_pages = writer.surfelPages();
    stats_.file_bytes = writer.fileBytes();
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  Progress& progress_;
  IndexStats stats_;
  PhaseClock clock_;
  std::uint64_t left_out_ = 0;
  std::vector<std::size_t> begins_;  // ranges with which those begin that were built
  RangeCounts left_;
};

void removeShards(const IndexShardJob& job, int rounds) {
  for (int shard = 1; shard <= job.count; ++shard) {
    for (int round = 1; round <= rounds; ++round) {
      unlink(job.path(IndexPass::kCount, shard, round).c_str());
    }
    unlink(job.path(IndexPass::kDistribute, shard).c_str());
    unlink(job.path(IndexPass::kBuild, shard).c_str());
  }
}

}  // namespace

Result<IndexStats> mergeIndexShards(const std::vector<std::string>& inputs,
                                    const std::string& output, const IndexOptions& options,
                                    int count, bool removes_shards, Progress& progress) {
  return guarded(output, [&]() -> Result<IndexStats> {
    if (count < 1 || count > kMostShards) {
      return Status::invalidArgument(
          fmt::format("{} shards, expected 1 to {}", count, kMostShards));
    }
    SURFEIT_ASSIGN_OR_RETURN(IndexShardJob job,
                             IndexShardJob::open(inputs, output, options, count, progress));
    Result<IndexStats> stats = Status::failed("merge: not run");
    withThreads(job.options.threads, [&] {
      stats = [&]() -> Result<IndexStats> {
        SURFEIT_ASSIGN_OR_RETURN(const IndexShardPlan plan, readPlan(job, "merge", progress));
        SURFEIT_ASSIGN_OR_RETURN(const IndexStats merged, IndexMerge(job, plan, progress).run());
        if (removes_shards) removeShards(job, plan.round);
        return merged;
      }();
    });
    return stats;
  });
}

}  // namespace surfeit
