#include "index/shards/index_shard_slabs.h"

#include <fmt/format.h>

#include <utility>

#include "index/shards/index_shard_passes.h"
#include "octree/build/built_slab_bytes.h"

namespace surfeit {
namespace {

// No slab takes more: a claim of more is damage.
constexpr std::uint64_t kMostSlabBytes = 512 << 20;

// Surfels that are left where repeated ones are left out.
void addLeft(const nlohmann::json& facts, RangeCounts& all) {
  const auto left = facts.value("left", std::vector<std::uint64_t>());
  if (left.size() != all.counts().size()) return;
  std::vector<RangeCount> counts(left.size());
  for (std::size_t i = 0; i < left.size(); ++i) counts[i].surfels = left[i];
  all.add(std::span<const RangeCount>(counts));
}

// That no range begins within a brick. `begins`: ranges with which those begin that were built.
Status checkLeft(const IndexShardJob& job, const RangeCounts& left,
                 const std::vector<std::size_t>& begins) {
  if (job.options.repeats != Repeats::kThin) return {};
  for (const std::size_t range : begins) {
    if (left.hasBefore(range, kBrickSurfels)) continue;
    return Status::invalidArgument(fmt::format(
        "{}: so many surfels repeat others that the curve cannot be cut before shard {}: index "
        "with fewer shards than {}, or on one machine",
        job.output, range + 1, job.count));
  }
  return {};
}

BuiltRange rangeOf(const nlohmann::json& facts, std::uint32_t begin_page) {
  BuiltRange range;
  range.begin_page = begin_page;
  range.end_page = begin_page + facts.value("pages", std::uint32_t{0});
  range.ends = {facts.value("begin_level", 0), facts.value("end_level", 0)};
  return range;
}

}  // namespace

Status ShardSlabs::append(const BuiltSlab& slab) {
  encodeBuiltSlab(slab, bytes_);
  surfels_ += slab.surfel_count;
  pages_ += slab.surfel_pages.pages.size();
  ++slabs_;
  const std::uint64_t head[] = {bytes_.size(), checksumOf(bytes_)};
  SURFEIT_RETURN_IF_ERROR(writer_.append(std::as_bytes(std::span(head))));
  return writer_.append(bytes_);
}

void ShardSlabs::addFacts(nlohmann::json& facts) const {
  facts["slabs"] = slabs_;
  facts["pages"] = pages_;
}

Result<bool> StoredSlabs::fetch(std::size_t work) {
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

Status StoredSlabs::build(std::size_t work, BuiltSlab& built) {
  const Stored& stored = stored_[work];
  if (checksumOf(stored.bytes) != stored.checksum) {
    return damaged(stored.shard,
                   Status::corruption(fmt::format("{}: a slab does not fit its checksum",
                                                  job_.path(pass_, stored.shard))));
  }
  const Status status = decodeBuiltSlab(stored.bytes, built);
  return status.ok() ? status : damaged(stored.shard, status);
}

Status StoredSlabs::openNext() {
  ++shard_;
  offset_ = 0;
  LackingShards lacking;
  SURFEIT_ASSIGN_OR_RETURN(reader_, openShard(job_.path(pass_, shard_), shard_,
                                              expectedShard(job_, plan_, shard_), lacking));
  return lacking.status(job_, passName(pass_), next_);
}

// Damage is named as what lacks; other failures pass.
Status StoredSlabs::damaged(int shard, const Status& status) const {
  if (status.code() != StatusCode::kCorruption) return status;
  LackingShards lacking;
  lacking.add(shard, status.message());
  return lacking.status(job_, passName(pass_), next_);
}

Result<BuiltShards> readBuilds(const IndexShardJob& job, const IndexShardPlan& plan,
                               const std::string& next, Progress& progress) {
  BuiltShards built;
  LackingShards lacking;
  RangeCounts left(plan.splitters);
  std::vector<std::size_t> begins;
  std::uint64_t surfels = 0;
  for (int shard = 1; shard <= job.count; ++shard) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const auto reader,
                             openShard(job.path(IndexPass::kBuild, shard), shard,
                                       expectedShard(job, plan, shard), lacking));
    if (!reader) continue;
    const nlohmann::json& facts = reader->facts();
    surfels += facts.value("surfels", std::uint64_t{0});
    built.left_out += facts.value("left_out", std::uint64_t{0});
    built.repeated += facts.value("repeated", std::uint64_t{0});
    built.ranges.push_back(rangeOf(facts, built.ranges.empty() ? 0 : built.ranges.back().end_page));
    if (shard > 1 && facts.value("begins", false)) begins.push_back(std::size_t(shard) - 1);
    addLeft(facts, left);
  }
  SURFEIT_RETURN_IF_ERROR(lacking.status(job, "build", next));
  SURFEIT_RETURN_IF_ERROR(checkLeft(job, left, begins));
  if (surfels == plan.totals.surfels) return built;
  return Status::failed(fmt::format("{}: {} surfels built, expected {}: this is a bug", job.output,
                                    surfels, plan.totals.surfels));
}

}  // namespace surfeit
