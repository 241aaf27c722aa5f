#include "index/shards/index_shard_places.h"

#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "index/shards/index_shard_passes.h"
#include "index/steps/index_plan.h"
#include "octree/build/octree_builder.h"
#include "octree/build/scene_writer.h"

namespace surfeit {
namespace {

using nlohmann::json;

json jsonOf(const ShardPlaces& places) {
  json ranges = json::array();
  for (const BuiltRange& range : places.built.ranges) {
    ranges.push_back(
        {range.begin_page, range.end_page, range.ends.begin_level, range.ends.end_level});
  }
  return {{"has_scene", places.has_scene},
          {"left_out", places.built.left_out},
          {"repeated", places.built.repeated},
          {"directory_checksum", places.directory_checksum},
          {"places", ranges}};
}

// False where these are none.
bool placesOf(const json& facts, int count, ShardPlaces& places) {
  try {
    places.has_scene = facts.at("has_scene").get<bool>();
    places.built.left_out = facts.at("left_out").get<std::uint64_t>();
    places.built.repeated = facts.at("repeated").get<std::uint64_t>();
    places.directory_checksum = facts.at("directory_checksum").get<std::uint64_t>();
    for (const json& range : facts.at("places")) {
      places.built.ranges.push_back({range.at(0).get<std::uint32_t>(),
                                     range.at(1).get<std::uint32_t>(),
                                     {range.at(2).get<int>(), range.at(3).get<int>()}});
    }
  } catch (const json::exception&) {
    return false;
  }
  return !places.has_scene || places.built.ranges.size() == std::size_t(count);
}

// Stitches the slabs of all builds.
Status writePlaces(const IndexShardJob& job, const IndexShardPlan& plan, const BuiltShards& built,
                   Progress& progress) {
  IndexTask task;
  task.memory_bytes = job.options.memory_bytes;
  task.threads = job.options.threads;
  task.records = plan.totals.surfels;
  task.slabs = {job.options.leaf_capacity, /* full_precision= */ true};
  SURFEIT_ASSIGN_OR_RETURN(const IndexPlan memory, planIndex(task));
  const std::optional<NormalRule> rule = normalRule(job, plan);
  const SceneDescription description = describe(job, plan, rule);
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<SceneWriter> writer,
      SceneWriter::create(placesPath(job), description.header(true), description.identity(true)));
  const std::uint64_t expected = plan.totals.surfels - built.left_out;
  progress.beginPhase("places", expected, "surfels");
  StoredSlabs slabs(job, plan, IndexPass::kBuild, "places", memory.slabs);
  SURFEIT_RETURN_IF_ERROR(stitchOctree(slabs, *writer, memory.slabs, progress));
  if (writer->header().surfel_count != expected) {
    return Status::failed(fmt::format("{}: {} surfels merged, expected {}: this is a bug",
                                      placesPath(job), writer->header().surfel_count, expected));
  }
  return writer->finish(description.provenance());
}

Status checkPages(const SceneFile& scene, const Progress& progress) {
  AlignedBuffer stored;
  std::vector<std::byte> payload;
  for (std::uint32_t page = 0; page < scene.pages().pageCount(); ++page) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_RETURN_IF_ERROR(scene.pages().readPage(page, stored, payload));
  }
  return {};
}

// Whether the scene of the facts is there, page by page; says why not.
Result<bool> isWhole(const IndexShardJob& job, const IndexShardPlan& plan, Progress& progress) {
  const Result<ShardPlaces> places = readPlaces(job, plan, "places");
  if (!places.ok()) return false;
  if (!places->has_scene) return true;
  const Result<SceneFile> scene = openPlaces(job, *places, "places");
  const Status status = scene.ok() ? checkPages(*scene, progress) : scene.status();
  if (status.code() == StatusCode::kInterrupted) return status;
  if (status.ok()) return true;
  if (access(placesPath(job).c_str(), F_OK) == 0) {
    progress.inform(placesPath(job) + ": not the places of this job, or damaged; made again");
  }
  return false;
}

}  // namespace

std::string placesPath(const IndexShardJob& job) { return job.output + ".places"; }

Status damagedPlaces(const IndexShardJob& job, const std::string& next, const Status& status) {
  if (status.code() != StatusCode::kCorruption) return status;
  LackingShards lacking;
  lacking.add(1, status.message());
  return lacking.status(job, passName(IndexPass::kPlaces), next);
}

Result<ShardPlaces> readPlaces(const IndexShardJob& job, const IndexShardPlan& plan,
                               const std::string& next) {
  LackingShards lacking;
  SURFEIT_ASSIGN_OR_RETURN(const auto reader, openShard(job.path(IndexPass::kPlaces, 1), 1,
                                                        expectedShard(job, plan, 1), lacking));
  ShardPlaces places;
  if (reader && !placesOf(reader->facts(), job.count, places)) {
    lacking.add(1, reader->path() + ": no places");
  }
  SURFEIT_RETURN_IF_ERROR(lacking.status(job, passName(IndexPass::kPlaces), next));
  return places;
}

Result<SceneFile> openPlaces(const IndexShardJob& job, const ShardPlaces& places,
                             const std::string& next) {
  const std::string path = placesPath(job);
  Result<SceneFile> scene = SceneFile::open(path, Access::kDirect);
  if (scene.ok() && scene->pages().directoryChecksum() == places.directory_checksum) return scene;
  if (!scene.ok() && access(path.c_str(), F_OK) == 0) {
    return damagedPlaces(job, next, scene.status());
  }
  return damagedPlaces(job, next,
                       Status::corruption(path + (scene.ok() ? " is of another job" : " is gone")));
}

Result<bool> makePlaces(const IndexShardJob& job, const IndexShardPlan& plan, int shard,
                        IndexShardStats& stats, Progress& progress) {
  if (shard > 1) return true;
  const std::string path = job.path(IndexPass::kPlaces, 1);
  const json expected = expectedShard(job, plan, 1);
  SURFEIT_ASSIGN_OR_RETURN(const bool is_there,
                           isFinished(path, expected, /* checks= */ true, progress));
  if (is_there) {
    SURFEIT_ASSIGN_OR_RETURN(const bool is_whole, isWhole(job, plan, progress));
    if (is_whole) return true;
  }
  ShardPlaces places;
  SURFEIT_ASSIGN_OR_RETURN(places.built, readBuilds(job, plan, "places", progress));
  places.has_scene = plan.needs_neighbours;
  if (places.has_scene) {
    SURFEIT_RETURN_IF_ERROR(writePlaces(job, plan, places.built, progress));
    SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(placesPath(job)));
    places.directory_checksum = scene.pages().directoryChecksum();
    stats.file_bytes += scene.fileBytes();
    stats.surfels += scene.header().surfel_count;
  }
  SURFEIT_ASSIGN_OR_RETURN(IndexShardWriter writer, IndexShardWriter::create(path));
  json facts = expected;
  facts.update(jsonOf(places));
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t bytes, writer.finish(facts));
  stats.file_bytes += bytes;
  return false;
}

}  // namespace surfeit
