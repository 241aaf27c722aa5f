// The count: what one machine learns in its first pass over the inputs, of a part of the records.
// Sums and bounds of parts add up to those of all. Bounds ask for an origin, and a far cloud may
// ask for another one than a sample of it did: then all parts are counted again, about that one, as
// one machine reads all again.

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <bit>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "index/shards/index_shard_job.h"
#include "index/steps/index_plan.h"
#include "index/steps/pinned_cube.h"
#include "index/steps/scene_place.h"

namespace surfeit {
namespace {

using nlohmann::json;

// Times that one machine reads all before it gives up.
constexpr int kMostRounds = 4;
// Places of a sample, of all shards and at least for each range.
constexpr std::uint64_t kShardSample = 65536, kLeastRangeSample = 64;

json jsonOf(const glm::dvec3& place) { return {place.x, place.y, place.z}; }

constexpr bool CloudChannels::*kChannelFlags[] = {
    &CloudChannels::normal,    &CloudChannels::radius,    &CloudChannels::area,
    &CloudChannels::radiosity, &CloudChannels::albedo,    &CloudChannels::two_sided,
    &CloudChannels::group,     &CloudChannels::long_side, &CloudChannels::opacity,
    &CloudChannels::tint};

json jsonOf(const CloudTotals& totals) {
  json text = {{"surfels", totals.surfels},
               {"skipped", totals.skipped},
               {"content", totals.content},
               {"missing_both", totals.missing_both},
               {"missing_area", totals.missing_area},
               {"missing_radius", totals.missing_radius},
               {"radius_from_area", totals.radius_from_area},
               {"spheres", totals.spheres},
               {"covering", totals.covering},
               {"bright", totals.bright},
               {"largest_albedo", totals.largest_albedo}};
  json channels = json::array();
  for (const auto flag : kChannelFlags) channels.push_back(totals.channels.*flag);
  text["channels"] = channels;
  if (!totals.bounds.isEmpty()) {
    text["bounds"] = {jsonOf(totals.bounds.min), jsonOf(totals.bounds.max)};
  }
  return text;
}

// Which surfels are in the sample follows from the surfels alone, not from how they are read.
std::uint64_t lotOf(const glm::vec3& place) { return XXH3_64bits(&place, sizeof place); }

json expectedCount(const IndexShardJob& job, int shard, int round) {
  return {{"job", job.identity},
          {"shard", shard},
          {"count", job.count},
          {"round", round},
          {"origin", jsonOf(job.reader.origin())}};
}

class ShardCount {
 public:
  ShardCount(const IndexShardJob& job, int shard, int round, Progress& progress)
      : job_(job),
        shard_(shard),
        round_(round),
        step_(std::max<std::uint64_t>(
            1, job.reader.recordCount() /
                   std::max(kShardSample, kLeastRangeSample * std::uint64_t(job.count)))),
        progress_(progress) {}

  Status run(IndexShardStats& stats) {
    const CloudReader::Records records = job_.recordsOf(shard_);
    std::optional<PinnedCube> pinned;
    if (job_.options.cube) pinned.emplace(*job_.options.cube);
    progress_.beginPhase("count", records.end - records.begin, "surfels");
    const auto consume = [&](std::span<Surfel> surfels, const Bounds3& bounds) -> Status {
      if (pinned) pinned->look(surfels, bounds, job_.reader.origin());
      take(surfels);
      return {};
    };
    SURFEIT_ASSIGN_OR_RETURN(const CloudTotals totals,
                             job_.reader.read(records, consume, progress_));
    stats.records += records.end - records.begin;
    stats.surfels += totals.surfels;
    return write(totals, pinned ? pinned->outside() : 0, stats);
  }

 private:
  void take(std::span<const Surfel> surfels) {
    std::vector<glm::vec3> places;
    for (const Surfel& surfel : surfels) {
      if (lotOf(surfel.position) % step_ == 0) places.push_back(surfel.position);
    }
    const std::lock_guard lock(mutex_);
    places_.insert(places_.end(), places.begin(), places.end());
    if (places_.size() < most_places_) return;
    sortPlaces();
    most_places_ = std::max(most_places_, 2 * places_.size());
  }

  // In an order that does not depend on threads; one of several at one place, for there may be any
  // number of these.
  void sortPlaces() {
    const auto orderOf = [](const glm::vec3& place) {
      return std::array{lotOf(place), std::uint64_t{std::bit_cast<std::uint32_t>(place.x)},
                        std::uint64_t{std::bit_cast<std::uint32_t>(place.y)}};
    };
    std::sort(places_.begin(), places_.end(),
              [&](const glm::vec3& a, const glm::vec3& b) { return orderOf(a) < orderOf(b); });
    places_.erase(std::unique(places_.begin(), places_.end()), places_.end());
  }

  Status write(const CloudTotals& totals, std::uint64_t outside, IndexShardStats& stats) {
    sortPlaces();
    SURFEIT_ASSIGN_OR_RETURN(IndexShardWriter writer, IndexShardWriter::create(job_.path(
                                                          IndexPass::kCount, shard_, round_)));
    SURFEIT_RETURN_IF_ERROR(writer.append(std::as_bytes(std::span(places_))));
    json facts = expectedCount(job_, shard_, round_);
    facts["totals"] = jsonOf(totals);
    facts["outside"] = outside;
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t bytes, writer.finish(facts));
    stats.file_bytes += bytes;
    return {};
  }

  const IndexShardJob& job_;
  const int shard_, round_;
  const std::uint64_t step_;  // surfels for one of the sample
  Progress& progress_;
  std::mutex mutex_;  // guards what is below
  std::vector<glm::vec3> places_;
  std::size_t most_places_ = 4 * kShardSample;  // before they are sorted
};

// The counts of a round, about the origin of the job's reader.
struct RoundCounts {
  LackingShards lacking;
  CloudTotals totals;
  std::uint64_t outside = 0;
};

// `stops`: at the first one that lacks.
Result<RoundCounts> readCounts(const IndexShardJob& job, int round, bool stops,
                               Progress& progress) {
  RoundCounts counts;
  std::vector<glm::vec3> places;
  for (int shard = 1; shard <= job.count; ++shard) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::optional<IndexShardReader> reader,
                             openShard(job.path(IndexPass::kCount, shard, round), shard,
                                       expectedCount(job, shard, round), counts.lacking));
    if (reader) {
      CloudTotals totals;
      const json& facts = reader->facts();
      const std::size_t size = static_cast<std::size_t>(reader->payloadBytes() / sizeof(glm::vec3));
      places.resize(size);
      SURFEIT_RETURN_IF_ERROR(reader->readAt(0, std::as_writable_bytes(std::span(places))));
      const Status checked = reader->check(progress);
      if (checked.code() == StatusCode::kInterrupted) return checked;
      if (!checked.ok() || !totalsOf(facts, totals)) {
        counts.lacking.add(shard,
                           checked.ok() ? reader->path() + ": no totals" : checked.message());
      }
      counts.totals.add(totals);
      counts.outside += facts.value("outside", std::uint64_t{0});
      for (const glm::vec3& place : places) {
        Surfel surfel;
        surfel.position = place;
        counts.totals.sample.push_back(surfel);
      }
    }
    if (stops && !counts.lacking.isEmpty()) break;
  }
  return counts;
}

Status checkTotals(const IndexShardJob& job, const RoundCounts& counts) {
  if (counts.totals.surfels == 0) {
    return Status::corruption(fmt::format("{}: no valid surfel in {} records",
                                          job.groups.inputs.front(), job.reader.recordCount()));
  }
  if (!job.options.cube) return {};
  PinnedCube pinned(*job.options.cube);
  pinned.addOutside(counts.outside);
  return pinned.status(counts.totals.surfels, counts.totals.bounds, job.reader.origin());
}

Status tooManyRounds(const IndexShardJob& job) {
  return Status::failed(
      fmt::format("{}: bounds ask for another origin again and again: an input changes meanwhile, "
                  "or give one (--origin X,Y,Z)",
                  job.output));
}

IndexShardPlan planOf(const IndexShardJob& job, RoundCounts counts, int round) {
  IndexShardPlan plan;
  plan.totals = std::move(counts.totals);
  plan.origin = job.reader.origin();
  plan.cube = cubeAsked(job.options, plan.totals.bounds, plan.origin);
  plan.round = round;
  const CloudTotals& totals = plan.totals;
  plan.needs_neighbours = totals.missesSizes() || normalRule(job, plan);
  plan.sample.resize(plan.totals.sample.size());
  if (!plan.sample.empty()) {
    curveKeys(&plan.totals.sample.front().position, sizeof(Surfel), plan.cube, plan.sample);
  }
  std::sort(plan.sample.begin(), plan.sample.end());
  plan.splitters =
      chooseRanges(plan.sample, plan.totals.surfels, job.count, leastBefore(job.options.repeats));
  const std::string text = job.identity.dump() + jsonOf(plan.totals).dump() +
                           jsonOf(plan.origin).dump() + json(plan.splitters).dump();
  plan.identity = fmt::format("{:016x}", XXH3_64bits(text.data(), text.size()));
  return plan;
}

}  // namespace

bool totalsOf(const json& facts, CloudTotals& totals) {
  try {
    const json& text = facts.at("totals");
    totals.surfels = text.at("surfels").get<std::uint64_t>();
    totals.skipped = text.at("skipped").get<std::uint64_t>();
    totals.content = text.at("content").get<std::uint64_t>();
    totals.missing_both = text.at("missing_both").get<std::uint64_t>();
    totals.missing_area = text.at("missing_area").get<std::uint64_t>();
    totals.missing_radius = text.at("missing_radius").get<std::uint64_t>();
    totals.radius_from_area = text.at("radius_from_area").get<std::uint64_t>();
    totals.spheres = text.at("spheres").get<std::uint64_t>();
    totals.covering = text.at("covering").get<std::uint64_t>();
    totals.bright = text.at("bright").get<std::uint64_t>();
    totals.largest_albedo = text.at("largest_albedo").get<float>();
    const json& channels = text.at("channels");
    for (std::size_t i = 0; i < std::size(kChannelFlags); ++i) {
      totals.channels.*kChannelFlags[i] = channels.at(i).get<bool>();
    }
    if (!text.contains("bounds")) return totals.surfels == 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = std::size_t(axis);
      totals.bounds.min[axis] = float(text.at("bounds").at(0).at(at).get<double>());
      totals.bounds.max[axis] = float(text.at("bounds").at(1).at(at).get<double>());
    }
  } catch (const json::exception&) {
    return false;
  }
  return true;
}

Result<bool> countShard(IndexShardJob& job, int shard, IndexShardStats& stats, Progress& progress) {
  job.reader.setOrigin(job.first_origin);
  bool was_counted = true;
  for (int round = 1; round <= kMostRounds; ++round) {
    SURFEIT_ASSIGN_OR_RETURN(
        const bool is_counted,
        isFinished(job.path(IndexPass::kCount, shard, round), expectedCount(job, shard, round),
                   /* checks= */ true, progress));
    if (!is_counted) {
      SURFEIT_RETURN_IF_ERROR(ShardCount(job, shard, round, progress).run(stats));
      was_counted = false;
    }
    SURFEIT_ASSIGN_OR_RETURN(const RoundCounts counts,
                             readCounts(job, round, /* stops= */ true, progress));
    if (!counts.lacking.isEmpty() || counts.totals.surfels == 0) return was_counted;
    const glm::dvec3 asked = originAsked(job.options, counts.totals.bounds, job.reader.origin());
    if (asked == job.reader.origin()) return was_counted;
    progress.inform(fmt::format(
        "{}: the cloud asks for the origin {} {} {}, which its sample did not: counted again",
        job.output, asked.x, asked.y, asked.z));
    job.reader.setOrigin(asked);
  }
  return tooManyRounds(job);
}

Result<IndexShardPlan> readPlan(IndexShardJob& job, const std::string& next, Progress& progress) {
  job.reader.setOrigin(job.first_origin);
  for (int round = 1; round <= kMostRounds; ++round) {
    SURFEIT_ASSIGN_OR_RETURN(RoundCounts counts,
                             readCounts(job, round, /* stops= */ false, progress));
    SURFEIT_RETURN_IF_ERROR(counts.lacking.status(job, "count", next));
    SURFEIT_RETURN_IF_ERROR(checkTotals(job, counts));
    const glm::dvec3 asked = originAsked(job.options, counts.totals.bounds, job.reader.origin());
    if (asked == job.reader.origin()) return planOf(job, std::move(counts), round);
    job.reader.setOrigin(asked);
  }
  return tooManyRounds(job);
}

}  // namespace surfeit
