// A bounce reads the scene twice: once to gather at its surfels, in the order of its pages, and
// once to write it again with what was found.
//
//   scene with B_0 ---------------+----------------------+
//                                 |                      |
//   scene with B_{k-1} --gather (all threads)--> B_k --rewrite--> scene with B_k
//
// Bounces before the last are files without a name.
#include "surfeit/bounce.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "batch/bounce_look.h"
#include "batch/gather_memory.h"
#include "batch/gather_options.h"
#include "batch/paging_controller.h"
#include "bounce/bounce_crew.h"
#include "bounce/bounce_radiosity.h"
#include "bounce/glossy_bounce.h"
#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/parallel.h"
#include "core/seconds_since.h"
#include "engine/planned_scene.h"
#include "engine/world.h"
#include "index/rows/row_sample.h"
#include "octree/read/group_set.h"
#include "octree/read/scene_file.h"
#include "octree/read/scene_light.h"
#include "octree/relight/radiosity_rewriter.h"
#include "storage/block_writer.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "storage/scratch_folder.h"

namespace surfeit {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kMostBounces = 100;
constexpr int kMostSurfelsPerReceiver = 64;
// Of a forecast, about.
constexpr std::uint64_t kSampledReceivers = 50'000;
// What a bounced scene's provenance holds its bounces under.
constexpr const char* kProvenanceKey = "bounce";

bool isGlossy(const BounceOptions& options) {
  return std::any_of(options.glossy.begin(), options.glossy.end(),
                     [](const GroupGloss& of_group) { return of_group.share > 0; });
}

GatherOptions gatherOptions(const BounceOptions& options) {
  GatherOptions gather;
  gather.mode = GatherMode::kBleeding;
  gather.quality = options.quality;
  gather.quality.max_variation = 0;  // bounces have receivers of their own to interpolate between
  gather.groups = options.groups;
  gather.memory_bytes = options.memory_bytes;
  gather.threads = options.threads;
  gather.cache_split = options.cache_split;
  gather.direct_io = options.direct_io;
  gather.prefetch = false;
  if (isGlossy(options)) gather.outputs = kOutputOcclusion | kOutputIrradiance | kOutputRadianceSh;
  return gather;
}

Status checkOptions(const BounceOptions& options) {
  const auto refuse = [](const char* what, int found, int most) {
    return Status::invalidArgument(fmt::format("{} is {}, expected 1 to {}", what, found, most));
  };
  if (options.bounces < 1 || options.bounces > kMostBounces) {
    return refuse("number of bounces", options.bounces, kMostBounces);
  }
  if (options.surfels_per_receiver < 1 || options.surfels_per_receiver > kMostSurfelsPerReceiver) {
    return refuse("surfels per receiver", options.surfels_per_receiver, kMostSurfelsPerReceiver);
  }
  if (options.quality.sides != GatherSides::kFront && options.quality.sides != GatherSides::kBoth) {
    return Status::invalidArgument("sides: found those that send no light, expected front or both");
  }
  SURFEIT_RETURN_IF_ERROR(checkLook(options.look));
  SURFEIT_RETURN_IF_ERROR(checkGroupCorrections(options.group_corrections));
  SURFEIT_RETURN_IF_ERROR(checkGlossy(options.glossy));
  GatherOptions gather = gatherOptions(options);
  gather.quality = options.quality;
  return checkGatherOptions(gather);
}

class Bouncer {
 public:
  Bouncer(const std::string& scene_path, const std::string& result_path,
          const BounceOptions& options, Progress& progress)
      : scene_path_(scene_path),
        result_path_(result_path),
        options_(options),
        gather_options_(withDefaults(gatherOptions(options))),
        progress_(progress),
        temporary_directory_(temporaryDirectory(options.temporary_directory, result_path)) {}

  Result<BounceStats> run();
  Result<SampleForecast> forecast();

 private:
  Status open();
  Status gatherSample(int bounce, int times, SampleForecast& forecast);
  Status writeSample(SampleForecast& forecast);
  Status checkScene() const;
  Status checkGroupsOfOptions() const;
  Status checkGlossyScene() const;
  void tellLobeAngle() const;
  Status checkMemory() const;
  std::uint64_t bytesBesideGather() const;
  std::uint64_t laterGrowthBytes() const;
  GatherWork gatherWork() const;
  Status gather(int bounce, SceneFile before, BounceRadiosity& radiosity, BouncePass& pass);
  Result<SceneFile> write(int bounce, BounceRadiosity& radiosity, BouncePass& pass);
  std::string phase(const char* what, int bounce) const;
  int surfelsPerReceiver(int bounce) const {
    const bool is_spared = bounce < options_.bounces || options_.spare_last;
    return is_spared ? options_.surfels_per_receiver : 1;
  }
  std::string provenance() const;

  const std::string& scene_path_;
  const std::string& result_path_;
  const BounceOptions& options_;
  const GatherOptions gather_options_;
  Progress& progress_;
  const std::string temporary_directory_;
  const bool is_glossy_ = isGlossy(options_);
  const GlossOfGroup gloss_ = glossByGroup(options_.glossy);
  std::optional<SceneFile> scene_;
  std::uint32_t stride_ = 1;          // as BounceCrew has it
  std::uint64_t without_mirror_ = 0;  // of the last bounce
  std::uint64_t gathered_surfels_ = 0;
  BounceStats stats_;
};

Status Bouncer::open() {
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path_, scene_path_, "scene"));
  noteSceneName(result_path_, progress_);
  SURFEIT_ASSIGN_OR_RETURN(scene_, SceneFile::open(scene_path_, sceneAccess(gather_options_)));
  SURFEIT_RETURN_IF_ERROR(checkScene());
  SURFEIT_RETURN_IF_ERROR(checkMemory());
  stats_.surfels = scene_->header().surfel_count;
  stats_.threads = gather_options_.threads;
  stats_.memory_bytes = gather_options_.memory_bytes;
  return noteDarkness(*scene_, progress_);
}

Result<BounceStats> Bouncer::run() {
  SURFEIT_RETURN_IF_ERROR(open());
  {
    // A result that cannot be written should not take hours to be refused
    SURFEIT_ASSIGN_OR_RETURN(const AtomicFile probe, AtomicFile::create(result_path_));
  }

  SURFEIT_ASSIGN_OR_RETURN(SceneFile before,
                           SceneFile::open(scene_path_, sceneAccess(gather_options_)));
  for (int bounce = 1; bounce <= options_.bounces; ++bounce) {
    BouncePass pass;
    const std::uint64_t before_bytes = bounce > 1 ? before.fileBytes() : 0;
    SURFEIT_ASSIGN_OR_RETURN(
        BounceRadiosity radiosity,
        BounceRadiosity::create(temporary_directory_, scene_->surfelPageCount(), is_glossy_));
    SURFEIT_RETURN_IF_ERROR(gather(bounce, std::move(before), radiosity, pass));
    SURFEIT_RETURN_IF_ERROR(radiosity.finish());
    SURFEIT_ASSIGN_OR_RETURN(before, write(bounce, radiosity, pass));
    const std::uint64_t written = bounce < options_.bounces ? before.fileBytes() : 0;
    stats_.temporary_bytes =
        std::max(stats_.temporary_bytes, radiosity.fileBytes() + std::max(before_bytes, written));
    stats_.passes.push_back(pass);
  }
  if (stats_.passes.front().largest_change == 0) {
    progress_.note(fmt::format(
        "warning: {}: no surfel receives light that it reflects; the result is as bright as the "
        "scene",
        result_path_));
  }
  if (without_mirror_ > 0) {
    progress_.note(fmt::format(
        "{}: {} surfels of glossy groups are two-sided or spheres, which have no mirror direction: "
        "they send their light evenly",
        result_path_, without_mirror_));
  }
  tellLobeAngle();
  return stats_;
}

void Bouncer::tellLobeAngle() const {
  const float angle = lobeNodeAngle(options_.glossy);
  if (angle >= GatherQuality().max_solid_angle) return;
  progress_.inform(fmt::format(
      "{}: gather with --max-solid-angle {:.2g} or less: a node, which has one lobe, then fills a "
      "fourth of the narrowest lobe at most",
      result_path_, angle));
}

// What a scene lacks shows before any work.
Status Bouncer::checkScene() const {
  const CloudChannels& channels = scene_->header().channels;
  if (!channels.albedo) {
    return Status::corruption(
        fmt::format("{}: found no albedo, expected one for every surfel, to reflect light by: "
                    "index clouds with albedo_r albedo_g albedo_b, as surfeit sample writes them",
                    scene_path_));
  }
  if (!channels.radiosity) {
    return Status::corruption(
        fmt::format("{}: found no radiosity, expected the emission and direct light that bounces: "
                    "index clouds with radiosity_r radiosity_g radiosity_b",
                    scene_path_));
  }
  const nlohmann::json json = nlohmann::json::parse(scene_->provenance(), nullptr, false);
  if (json.is_object() && json.contains(kProvenanceKey)) {
    return Status::invalidArgument(
        fmt::format("{}: holds bounces already, which would count again: expected the scene that "
                    "it was made from",
                    scene_path_));
  }
  SURFEIT_RETURN_IF_ERROR(checkGroupsOfOptions());
  SURFEIT_RETURN_IF_ERROR(checkGlossyScene());
  return checkGroups(*scene_, options_.groups);
}

// Corrections and gloss of groups that the scene lacks change nothing.
Status Bouncer::checkGroupsOfOptions() const {
  std::uint64_t corrected = 0, glossy = 0;
  for (const GroupCorrection& of : options_.group_corrections) corrected |= groupBit(of.group);
  for (const GroupGloss& of : options_.glossy) glossy |= groupBit(of.group);
  if ((corrected | glossy) == 0) return {};
  SURFEIT_RETURN_IF_ERROR(checkGroups(*scene_, corrected | glossy));
  SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t present, scene_->readGroups());
  const auto tell = [&](std::uint64_t absent, const char* what) {
    if (absent == 0) return;
    progress_.note(fmt::format("{}: has no surfels of groups {}: their {} nothing", scene_path_,
                               describeGroups(absent), what));
  };
  tell(corrected & ~present, "corrections change");
  tell(glossy & ~present, "gloss changes");
  return {};
}

// Pages of version 1 lack columns that those of later versions have.
Status Bouncer::checkGlossyScene() const {
  if (!is_glossy_ || scene_->header().pageForm().has_bounds) return {};
  return Status::invalidArgument(fmt::format(
      "{}: format version {}, expected 2 or more for glossy surfels: index the clouds again",
      scene_path_, scene_->header().format_version));
}

GatherWork Bouncer::gatherWork() const {
  return {.rules = GatherRules(gather_options_),
          .threads = gather_options_.threads,
          .cache_split = options_.cache_split};
}

// What gathering and rewriting take beside what a gather of no receivers takes.
std::uint64_t Bouncer::bytesBesideGather() const {
  const auto threads = static_cast<std::uint64_t>(gather_options_.threads);
  const std::uint64_t directory = scene_->pages().memoryBytes();
  return 2 * directory + BounceRadiosity::memoryBytes(scene_->surfelPageCount()) +
         threads * BounceCrew::threadBytes(*scene_, options_.surfels_per_receiver, is_glossy_) +
         BlockWriter::kDefaultBlocks * BlockWriter::kBlockBytes +
         rewriteRadiosityBytes(*scene_, gather_options_.threads, is_glossy_);
}

// What a gather of a later bounce may take more than one of the scene: pages may be a little
// larger, stored and decompressed, by colors where there were none, of surfels or of nodes and
// their facets.
std::uint64_t Bouncer::laterGrowthBytes() const {
  if (options_.bounces == 1) return 0;
  const SceneHeader& header = scene_->header();
  const std::uint64_t most_colors = std::max<std::uint64_t>(
      header.surfel_group_capacity, std::uint64_t{header.node_group_capacity} * (1 + kMostFacets));
  // Lobes in the two pages of each cache that a thread needs, in pages as they are read, and in
  // scratch
  const std::uint64_t lobes = is_glossy_ ? 8 * (header.surfel_group_capacity * sizeof(Lobe) +
                                                header.node_group_capacity * sizeof(NodeLobes))
                                         : 0;
  return static_cast<std::uint64_t>(gather_options_.threads) *
         (2 * most_colors * sizeof(glm::vec3) + lobes);
}

Status Bouncer::checkMemory() const {
  const std::uint64_t least =
      leastGatherMemory(*scene_, gatherWork()) + bytesBesideGather() + laterGrowthBytes();
  if (gather_options_.memory_bytes >= least) return {};
  return refuseBudget(
      gather_options_.memory_bytes,
      fmt::format("{} with {}", scene_path_, describeThreads(gather_options_.threads)), least);
}

std::string Bouncer::phase(const char* what, int bounce) const {
  return fmt::format("{} {}/{}", what, bounce, options_.bounces);
}

Status Bouncer::gather(int bounce, SceneFile before, BounceRadiosity& radiosity, BouncePass& pass) {
  SURFEIT_ASSIGN_OR_RETURN(
      const GatherMemory memory,
      planGatherMemory(before, gather_options_.memory_bytes - bytesBesideGather(), gatherWork()));
  SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<SceneState> scene,
                           openPlanned(std::move(before), memory.caches,
                                       monitoring(memory.caches, options_.cache_split < 0)));
  const std::shared_ptr<const World> world =
      World::ofPlanned(std::move(scene), GatherRules(gather_options_));
  progress_.beginPhase(phase("bounce", bounce), stats_.surfels, "surfels");
  const Clock::time_point begin = Clock::now();
  PagingController controller(*world,
                              {.threads = gather_options_.threads,
                               .prefetches = false,
                               .memory_bytes = gather_options_.memory_bytes - bytesBesideGather(),
                               .work = memory.work,
                               .beside_bytes = bytesBesideGather(),
                               .receivers = stats_.surfels},
                              progress_);
  BounceCrew crew({.scene = *scene_,
                   .world = world,
                   .look = countedFrom(options_.look, scene_->header().origin),
                   .of_groups = byGroup(options_.group_corrections),
                   .gloss = is_glossy_ ? &gloss_ : nullptr,
                   .surfels_per_receiver = surfelsPerReceiver(bounce),
                   .threads = gather_options_.threads,
                   .stride = stride_,
                   .radiosity = radiosity,
                   .controller = controller,
                   .progress = progress_});
  SURFEIT_RETURN_IF_ERROR(crew.run());
  controller.finish();
  without_mirror_ = crew.withoutMirror();
  pass.receivers = crew.receivers();
  gathered_surfels_ = crew.surfels();
  pass.largest_change = crew.largestChange();
  pass.gather_seconds = secondsSince(begin);
  pass.node_cache = world->engine().monitor.nodeStats();
  pass.surfel_cache = world->engine().monitor.surfelStats();
  return {};
}

// The scene with this bounce: a file without a name, which is returned; at last the result, and
// what is returned is the scene itself.
Result<SceneFile> Bouncer::write(int bounce, BounceRadiosity& radiosity, BouncePass& pass) {
  progress_.beginPhase(phase("write", bounce), stats_.surfels, "surfels");
  const Clock::time_point begin = Clock::now();
  const std::string text = provenance();
  const std::uint64_t parts[] = {scene_->pages().identity(), radiosity.content(),
                                 XXH3_64bits(text.data(), text.size())};
  const std::uint64_t identity = XXH3_64bits(parts, sizeof parts);
  const bool is_last = bounce == options_.bounces;
  SURFEIT_ASSIGN_OR_RETURN(
      PageFileWriter writer,
      PageFileWriter::create(is_last ? result_path_ : temporary_directory_ + "/surfeit-bounce.sft",
                             identity, rewrittenVersion(*scene_, is_glossy_)));
  Result<glm::dvec3> mean = Status::failed("bounce: not written");
  withThreads(gather_options_.threads, [&] {
    mean = rewriteRadiosity(*scene_, radiosity, writer, gather_options_.threads, progress_);
  });
  SURFEIT_RETURN_IF_ERROR(mean.status());
  pass.mean_radiosity = *mean;
  const std::vector<std::byte> fields = rewrittenSceneFields(*scene_, is_glossy_);
  if (is_last) {
    SURFEIT_RETURN_IF_ERROR(writer.finish(fields, text));
    stats_.file_bytes = writer.fileBytes();
    pass.write_seconds = secondsSince(begin);
    return SceneFile();
  }
  SURFEIT_ASSIGN_OR_RETURN(PageFile pages, writer.finishUnnamed(fields, text));
  pass.write_seconds = secondsSince(begin);
  return SceneFile::open(std::move(pages));
}

// A bounce of `times` that are alike, by some of the surfels.
Status Bouncer::gatherSample(int bounce, int times, SampleForecast& forecast) {
  const auto spared = std::uint64_t(surfelsPerReceiver(bounce));
  const std::uint64_t receivers = stats_.surfels / spared;
  stride_ = std::uint32_t(std::max<std::uint64_t>(1, receivers / kSampledReceivers));
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene,
                           SceneFile::open(scene_path_, sceneAccess(gather_options_)));
  SURFEIT_ASSIGN_OR_RETURN(
      BounceRadiosity radiosity,
      BounceRadiosity::create(temporary_directory_, scene_->surfelPageCount(), is_glossy_));
  BouncePass pass;
  SURFEIT_RETURN_IF_ERROR(gather(bounce, std::move(scene), radiosity, pass));
  const double scale = double(stats_.surfels) / double(gathered_surfels_);
  forecast.sampled_records = std::max(forecast.sampled_records, gathered_surfels_);
  forecast.seconds += times * scale * pass.gather_seconds;
  forecast.temporary_bytes = std::uint64_t(scale * double(radiosity.fileBytes()));
  return {};
}

// What it takes to write the scene, by a scene of some surfels.
Status Bouncer::writeSample(SampleForecast& forecast) {
  SURFEIT_ASSIGN_OR_RETURN(const ScratchFolder folder, ScratchFolder::create(temporary_directory_));
  SURFEIT_ASSIGN_OR_RETURN(const SceneSample sample, sampleScene(scene_path_, folder, progress_));
  const std::string result = folder.file("result.sft");
  BounceOptions once = options_;
  once.bounces = 1;
  once.spare_last = true;  // within the memory of the job
  SilentProgress silent(progress_);
  SURFEIT_ASSIGN_OR_RETURN(const BounceStats stats,
                           Bouncer(sample.path, result, once, silent).run());
  forecast.seconds += options_.bounces * sample.times() * stats.passes[0].write_seconds;
  forecast.output_bytes =
      std::uint64_t(double(sample.bytes) * double(stats.file_bytes) / double(sample.sampled_bytes));
  if (options_.bounces > 1) forecast.temporary_bytes += forecast.output_bytes;
  return {};
}

Result<SampleForecast> Bouncer::forecast() {
  SURFEIT_RETURN_IF_ERROR(open());
  SampleForecast forecast;
  forecast.records = stats_.surfels;
  forecast.input_bytes = scene_->fileBytes();
  forecast.memory_bytes = stats_.memory_bytes;
  const int last = options_.bounces;
  if (surfelsPerReceiver(1) == surfelsPerReceiver(last)) {
    SURFEIT_RETURN_IF_ERROR(gatherSample(last, last, forecast));
  } else {
    SURFEIT_RETURN_IF_ERROR(gatherSample(1, last - 1, forecast));
    SURFEIT_RETURN_IF_ERROR(gatherSample(last, 1, forecast));
  }
  SURFEIT_RETURN_IF_ERROR(writeSample(forecast));
  return forecast;
}

// What the scene's says, and what decides about the bounces.
std::string Bouncer::provenance() const {
  nlohmann::json json = nlohmann::json::parse(scene_->provenance(), nullptr, false);
  if (!json.is_object()) json = nlohmann::json::object();
  const GatherQuality& quality = options_.quality;
  json[kProvenanceKey] = {{"bounces", options_.bounces},
                          {"surfels_per_receiver", options_.surfels_per_receiver},
                          {"max_solid_angle", quality.max_solid_angle},
                          {"raster_resolution", quality.raster_resolution},
                          {"near_field_radii", quality.near_field_radii},
                          {"bias", quality.bias},
                          {"max_distance", quality.max_distance},
                          {"both_sides", quality.sides == GatherSides::kBoth}};
  if (options_.spare_last) json[kProvenanceKey]["spare_last"] = true;
  if (!options_.look.isOff() || !options_.group_corrections.empty()) {
    json[kProvenanceKey]["look"] = identityOf(options_.look, options_.group_corrections);
  }
  if (is_glossy_) {
    nlohmann::json& glossy = json[kProvenanceKey]["glossy"] = nlohmann::json::array();
    std::map<std::uint32_t, GroupGloss> by_group;  // bytes do not depend on the order
    for (const GroupGloss& of : options_.glossy) by_group[of.group] = of;
    for (const auto& [group, of] : by_group) {
      glossy.push_back({{"group", group}, {"share", of.share}, {"roughness", of.roughness}});
    }
  }
  if (options_.groups != kAllGroups) {
    json[kProvenanceKey]["groups"] = describeGroups(options_.groups);
  }
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

Result<BounceStats> bounceScene(const std::string& scene_path, const std::string& result_path,
                                const BounceOptions& options, Progress& progress) {
  return guarded(result_path, [&]() -> Result<BounceStats> {
    SURFEIT_RETURN_IF_ERROR(checkOptions(options));
    return Bouncer(scene_path, result_path, options, progress).run();
  });
}

Result<SampleForecast> forecastBounce(const std::string& scene_path, const std::string& result_path,
                                      const BounceOptions& options, Progress& progress) {
  return guarded(result_path, [&]() -> Result<SampleForecast> {
    SURFEIT_RETURN_IF_ERROR(checkOptions(options));
    return Bouncer(scene_path, result_path, options, progress).forecast();
  });
}

}  // namespace surfeit
