#include "index/shards/index_shard_job.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/job_limits.h"
#include "core/json_difference.h"
#include "core/number_ranges.h"
#include "index/steps/index_plan.h"
#include "index/steps/pinned_cube.h"
#include "index/steps/scene_place.h"
#include "storage/output_target.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

using nlohmann::json;

// Why the facts of a file are not the expected ones; empty when they are.
std::string differenceIn(const json& facts, const json& expected) {
  for (const auto& [name, value] : expected.items()) {
    if (!facts.contains(name)) return name + " is absent";
    if (facts.at(name) == value) continue;
    return differenceOf(json{{name, facts.at(name)}}, json{{name, value}});
  }
  return {};
}

json identityOf(const IndexShardJob& job) {
  const IndexOptions& options = job.options;
  json identity = {{"version", kVersion},
                   {"rows", job.reader.records()},
                   {"bytes", job.reader.fileBytes()},
                   {"channels", options.channels},
                   {"part", options.part},
                   {"filter", options.filter},
                   {"color_range", static_cast<int>(options.color_range)},
                   {"leaf_capacity", options.leaf_capacity},
                   {"disk_overlap", options.disk_overlap},
                   {"repeats", static_cast<int>(options.repeats)},
                   {"full_precision", options.full_precision},
                   {"up", static_cast<int>(job.up())}};
  if (options.origin) {
    identity["origin"] = {options.origin->x, options.origin->y, options.origin->z};
  }
  if (const auto& cube = options.cube) {
    identity["cube"] = {cube->corner.x, cube->corner.y, cube->corner.z, cube->size};
  }
  if (const auto& normals = options.normals) {
    const glm::dvec3& sensor = normals->orientation.sensor;
    identity["normals"] = {static_cast<int>(normals->orientation.toward), sensor.x, sensor.y,
                           sensor.z, normals->thin_is_two_sided};
  }
  if (!job.groups.names.empty()) {
    json groups = json::array();
    for (const auto& group : job.groups.of_inputs) groups.push_back(group ? int(*group) : -1);
    identity["groups"] = {{"names", job.groups.names}, {"of_inputs", groups}};
  }
  return identity;
}

Status checkShardInputs(const GroupPlan& groups, const std::string& output,
                        const IndexOptions& options) {
  if (groups.inputs.empty()) return Status::invalidArgument("index: no input cloud");
  for (const std::string& input : groups.inputs) {
    if (input != "-") continue;
    return Status::invalidArgument(
        "-: passes over shards read their inputs again, expected names of files");
  }
  SURFEIT_ASSIGN_OR_RETURN(const OutputTarget target, resolveOutput(output));
  if (target.is_stream) {
    return Status::invalidArgument(
        fmt::format("{}: shards stand beside the scene, expected the name of a file", output));
  }
  return checkIndexOptions(options);
}

}  // namespace

Result<IndexShardJob> IndexShardJob::open(const std::vector<std::string>& inputs,
                                          const std::string& output, const IndexOptions& given,
                                          int count, Progress& progress) {
  IndexOptions options = given;
  if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes(kUsualIndexMemory);
  options.threads = indexThreads(options, progress);
  SURFEIT_ASSIGN_OR_RETURN(GroupPlan groups, planGroups(inputs, options.named, true));
  SURFEIT_RETURN_IF_ERROR(checkShardInputs(groups, output, options));
  SURFEIT_ASSIGN_OR_RETURN(const RowReaderOptions reading, readingOf(options));
  SURFEIT_ASSIGN_OR_RETURN(CloudReader reader,
                           CloudReader::open(groups.inputs, options.strict,
                                             readBytesWithin(options.memory_bytes), reading));
  reader.setGroups(groups.of_inputs);
  std::vector<std::string> notes = reader.notes();
  GroupNames group_names = groupNames(groups, reader, notes);
  for (const std::string& note : notes) progress.note(note);
  // As one machine takes it
  if (options.origin || options.cube) reader.setOrigin(originAsked(options, {}, {}));
  if (reader.recordCount() > kReadBatch && reader.isSeekable()) {
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<Surfel> sample,
                             reader.sample(usualBucketCount(reader.recordCount())));
    Bounds3 bounds;
    for (const Surfel& surfel : sample) bounds.add(surfel.position);
    if (!sample.empty()) reader.setOrigin(originAsked(options, bounds, reader.origin()));
  }
  const glm::dvec3 origin = reader.origin();
  IndexShardJob job{std::move(groups),
                    std::move(group_names),
                    output,
                    options,
                    count,
                    std::move(reader),
                    origin,
                    nullptr,
                    temporaryDirectory(options.temporary_directory, output)};
  job.identity = identityOf(job);
  return job;
}

CloudReader::Records IndexShardJob::recordsOf(int shard) const {
  const std::uint64_t records = reader.recordCount();
  const auto end = [&](int shards) {
    const auto whole = records / std::uint64_t(count), rest = records % std::uint64_t(count);
    return whole * std::uint64_t(shards) + rest * std::uint64_t(shards) / std::uint64_t(count);
  };
  return {end(shard - 1), end(shard)};
}

std::optional<NormalRule> normalRule(const IndexShardJob& job, const IndexShardPlan& plan) {
  if (!job.options.normals || plan.totals.spheres == 0) return std::nullopt;
  return NormalRule(*job.options.normals, job.up(), plan.origin,
                    glm::vec3(plan.totals.bounds.centre()));
}

SceneDescription describe(const IndexShardJob& job, const IndexShardPlan& plan,
                          const std::optional<NormalRule>& rule) {
  return {job.options, job.group_names,         plan.totals,     plan.origin,
          job.up(),    rule ? &*rule : nullptr, job.reader.crs()};
}

void LackingShards::add(int shard, const std::string& reason) {
  shards_.push_back(shard);
  if (reason_.empty()) reason_ = reason;
}

Status LackingShards::status(const IndexShardJob& job, const char* pass,
                             const std::string& next) const {
  if (shards_.empty()) return {};
  return Status::incomplete(
      fmt::format("{}: shards {} of {} are missing{}; run surfeit index --pass {} for them (sbatch "
                  "--array={}), "
                  "then {} again",
                  job.output, numberRanges(shards_), job.count,
                  reason_.empty() ? "" : fmt::format(" ({})", reason_), pass,
                  numberRanges(shards_, ","), next));
}

Result<bool> isFinished(const std::string& path, const json& expected, bool checks,
                        Progress& progress) {
  const Result<IndexShardReader> reader = IndexShardReader::open(path);
  if (!reader.ok()) {
    if (reader.status().code() == StatusCode::kCorruption) {
      progress.inform(reader.status().message() + "; made again");
    }
    return false;  // what cannot be opened shows when it is written
  }
  const std::string difference = differenceIn(reader->facts(), expected);
  if (!difference.empty()) {
    progress.inform(fmt::format("{}: of another job: {}; made again", path, difference));
    return false;
  }
  if (!checks) return true;
  const Status checked = reader->check(progress);
  if (checked.code() == StatusCode::kInterrupted) return checked;
  if (!checked.ok()) progress.inform(checked.message() + "; made again");
  return checked.ok();
}

Result<std::optional<IndexShardReader>> openShard(const std::string& path, int shard,
                                                  const json& expected, LackingShards& lacking) {
  Result<IndexShardReader> reader = IndexShardReader::open(path);
  if (!reader.ok()) {
    const bool is_there = access(path.c_str(), F_OK) == 0;
    if (is_there && reader.status().code() != StatusCode::kCorruption) return reader.status();
    lacking.add(shard, is_there ? reader.status().message() : std::string());
    return std::optional<IndexShardReader>();
  }
  const std::string difference = differenceIn(reader->facts(), expected);
  if (!difference.empty()) {
    lacking.add(shard, fmt::format("{} is of another job: {}", path, difference));
    return std::optional<IndexShardReader>();
  }
  return std::optional<IndexShardReader>(std::move(*reader));
}

}  // namespace surfeit
