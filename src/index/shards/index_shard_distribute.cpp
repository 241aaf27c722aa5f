// The distribution: surfels of a part of the records go to the ranges of the curve. They wait in
// blocks, in memory and then in a temporary file of this machine, as they do on one machine; the
// file of the shard has them range by range, so that a build reads one piece of it.

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/program_memory.h"
#include "core/thread_scratch.h"
#include "index/shards/index_shard_passes.h"
#include "index/shards/index_shard_pieces.h"
#include "index/steps/index_plan.h"
#include "octree/build/surfel_block.h"
#include "octree/build/surfel_store.h"
#include "octree/neighbours/local_density.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kMega = 1 << 20;
constexpr std::size_t kMostOpenSurfels = 2048, kLeastOpenSurfels = 256;
// Buffers of the file and of the temporary one.
constexpr std::uint64_t kBufferBytes = 12 * kMega;

class ShardDistribution {
 public:
  ShardDistribution(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                    Progress& progress)
      : job_(job), plan_(plan), shard_(shard), progress_(progress), counts_(plan.splitters) {}

  Status run(IndexShardStats& stats) {
    SURFEIT_ASSIGN_OR_RETURN(SurfelStore::Plan store_plan, planStore());
    SurfelStore store(std::move(store_plan));
    const CloudReader::Records records = job_.recordsOf(shard_);
    progress_.beginPhase("distribute", records.end - records.begin, "surfels");
    const auto consume = [&](std::span<Surfel> surfels, const Bounds3&) {
      return add(surfels, store);
    };
    SURFEIT_ASSIGN_OR_RETURN(const CloudTotals totals,
                             job_.reader.read(records, consume, progress_));
    SURFEIT_RETURN_IF_ERROR(checkUnchanged(totals));
    SURFEIT_RETURN_IF_ERROR(store.finish());
    stats.records += records.end - records.begin;
    stats.surfels += totals.surfels;
    stats.temporary_bytes = std::max(stats.temporary_bytes, store.temporaryBytes());
    return write(store, stats);
  }

 private:
  // Half of what is left is for open blocks of all ranges, the rest for full ones.
  Result<SurfelStore::Plan> planStore() const {
    const IndexOptions& options = job_.options;
    const std::uint64_t fixed =
        programBytes(options.threads) + kBufferBytes +
        CloudReader::memoryBytes(readBytesWithin(options.memory_bytes), options.threads) +
        plan_.sample.size() * (sizeof(Surfel) + sizeof(CurveKey)) +
        plan_.rangeCount() * (sizeof(ShardPiece) + 3 * sizeof(RangeCount)) * 2;
    const std::uint64_t range_bytes = plan_.rangeCount() * sizeof(Surfel);
    const std::uint64_t least =
        std::max(kLeastIndexMemory, fixed + 2 * range_bytes * kLeastOpenSurfels);
    if (options.memory_bytes < least) {
      return Status::budgetTooSmall(fmt::format(
          "--memory of {} MiB is too small to distribute to {} ranges with {} threads: {} MiB is "
          "the least that works",
          options.memory_bytes >> 20, plan_.rangeCount(), options.threads,
          (least + kMega - 1) >> 20));
    }
    SurfelStore::Plan plan;
    plan.splitters = plan_.splitters;
    plan.block_surfels = std::clamp<std::size_t>(
        static_cast<std::size_t>((options.memory_bytes - fixed) / 2 / range_bytes),
        kLeastOpenSurfels, kMostOpenSurfels);
    plan.memory_bytes = options.memory_bytes - fixed - range_bytes * plan.block_surfels;
    plan.temporary_directory = job_.temporary_directory;
    return plan;
  }

  Status add(std::span<Surfel> surfels, SurfelStore& store) {
    if (surfels.empty()) return {};
    std::vector<CurveKey>& keys = threadScratch<std::vector<CurveKey>>([] {});
    keys.resize(surfels.size());
    curveKeys(&surfels.front().position, sizeof(Surfel), plan_.cube, keys);
    counts_.add(keys);
    for (Surfel& surfel : surfels) {
      applySizeRules(surfel, job_.options.disk_overlap);
      // As one machine has it: positions are told apart by their bits
      if (job_.options.repeats == Repeats::kThin) surfel.position += glm::vec3(0);
    }
    return store.add(surfels, keys);
  }

  // The part has the surfels that were counted.
  Status checkUnchanged(const CloudTotals& totals) const {
    LackingShards lacking;
    SURFEIT_ASSIGN_OR_RETURN(
        const auto reader,
        openShard(job_.path(IndexPass::kCount, shard_, plan_.round), shard_, {}, lacking));
    CloudTotals counted;
    if (reader && totalsOf(reader->facts(), counted) && counted.surfels == totals.surfels &&
        counted.content == totals.content) {
      return {};
    }
    return Status::failed(
        fmt::format("{}: {} surfels when read again, {} when counted, or other ones: an input "
                    "changed meanwhile; "
                    "remove the files beside the scene, and begin anew",
                    job_.output, totals.surfels, counted.surfels));
  }

  Status write(const SurfelStore& store, IndexShardStats& stats) {
    SURFEIT_ASSIGN_OR_RETURN(IndexShardWriter writer,
                             IndexShardWriter::create(job_.path(IndexPass::kDistribute, shard_)));
    progress_.beginPhase("write", stats.surfels, "surfels");
    std::vector<ShardPiece> pieces;
    AlignedBuffer buffer;
    for (std::size_t range = 0; range < store.bucketCount(); ++range) {
      ShardPiece piece;
      piece.offset = writer.payloadBytes();
      std::vector<PieceBlock> blocks;
      for (const SurfelStore::Block& block : store.blocks(range)) {
        blocks.push_back({block.bytes, block.surfels});
      }
      SURFEIT_RETURN_IF_ERROR(writer.append(std::as_bytes(std::span(blocks))));
      for (const SurfelStore::Block& block : store.blocks(range)) {
        if (progress_.isCancelled()) return Status::interrupted();
        SURFEIT_ASSIGN_OR_RETURN(const Bytes packed, store.fetch(block, buffer));
        SURFEIT_RETURN_IF_ERROR(writer.append(packed));
        progress_.advance(block.surfels);
      }
      piece.bytes = writer.payloadBytes() - piece.offset;
      piece.blocks = blocks.size();
      piece.surfels = store.surfelCount(range);
      pieces.push_back(piece);
    }
    nlohmann::json facts = expectedShard(job_, plan_, shard_);
    SURFEIT_RETURN_IF_ERROR(appendTables(pieces, counts_.counts(), writer, facts));
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t bytes, writer.finish(facts));
    stats.file_bytes += bytes;
    return {};
  }

  const IndexShardJob& job_;
  const IndexShardPlan& plan_;
  const int shard_;
  Progress& progress_;
  RangeCounts counts_;
};

}  // namespace

nlohmann::json expectedShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard) {
  return {{"job", job.identity},
          {"plan", plan.identity},
          {"shard", shard},
          {"count", job.count},
          {"ranges", plan.rangeCount()}};
}

Result<bool> distributeShard(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                             IndexShardStats& stats, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(
      const bool is_finished,
      isFinished(job.path(IndexPass::kDistribute, shard), expectedShard(job, plan, shard),
                 /* checks= */ true, progress));
  if (is_finished) return true;
  SURFEIT_RETURN_IF_ERROR(ShardDistribution(job, plan, shard, progress).run(stats));
  return false;
}

}  // namespace surfeit
