// surfeit gather: occlusion and color bleeding at receivers.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "surfeit/bake.h"
#include "surfeit/process.h"
#include "surfeit/shards.h"
#include "surfeit/tune.h"
#include "tools/cache_report.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/gather_options.h"
#include "tools/light_options.h"
#include "tools/shard_option.h"

namespace surfeit {
namespace {

struct GatherArguments {
  bool is_dry_run = false;
  std::string scene, receivers, result, series;
  GatherOptions options;
  std::optional<ShardRange> shard;
  bool resumes = false;
  int resumed_shards = 0;  // 0: as the library thinks best
};

// --dry-run: what tune finds out, at the budget of the gather.
Status sayForecast(const GatherArguments& arguments, CommandContext& context) {
  SURFEIT_ASSIGN_OR_RETURN(
      const GatherForecast forecast,
      forecastGather(arguments.scene, arguments.receivers, arguments.options, context.progress()));
  context.answer(fmt::format(
      "{}: {} receivers, by a sample of {}:\n"
      "  memory           {} (the least that works {}, recommended {})\n"
      "  temporary files  at most {}\n"
      "  result           about {}, where it is no text and not compressed\n"
      "  time             about {:.0f} s with {} threads\n"
      "Nothing was written.",
      arguments.result, formatCount(forecast.receivers), formatCount(forecast.sampled_receivers),
      formatBytes(forecast.memory_bytes), formatBytes(forecast.least_memory_bytes),
      formatBytes(forecast.recommended_memory_bytes), formatBytes(forecast.temporary_bytes),
      formatBytes(forecast.result_bytes), forecast.seconds, forecast.threads));
  return context.writeStats({{"command", "gather"},
                             {"dry_run", true},
                             {"receivers", forecast.receivers},
                             {"sampled_receivers", forecast.sampled_receivers},
                             {"memory_bytes", forecast.memory_bytes},
                             {"recommended_memory_bytes", forecast.recommended_memory_bytes},
                             {"temporary_bytes", forecast.temporary_bytes},
                             {"output_bytes", forecast.result_bytes},
                             {"seconds", forecast.seconds}});
}

// All of the receivers, or some shards.
Result<ShardStats> gatherAsAsked(const GatherArguments& arguments, CommandContext& context) {
  const auto& [is_dry_run, scene, receivers, result, series, options, shard, resumes, shards] =
      arguments;
  if (shard) {
    return gatherShards(scene, receivers, result, options, *shard, context.progress());
  }
  if (resumes) {
    return gatherResumable(scene, receivers, result, options, shards, context.progress());
  }
  ShardStats stats;
  if (context.kept_scene != nullptr) {
    SURFEIT_ASSIGN_OR_RETURN(
        static_cast<GatherStats&>(stats),
        gatherCloud(scene, receivers, result, options, context.progress(), *context.kept_scene));
    return stats;
  }
  SURFEIT_ASSIGN_OR_RETURN(static_cast<GatherStats&>(stats),
                           gatherCloud(scene, receivers, result, options, context.progress()));
  return stats;
}

// "shard 3 of 16: "; what was done before is said.
std::string describeShards(const GatherArguments& arguments, const ShardStats& stats) {
  if (!arguments.shard && !arguments.resumes) return {};
  std::string text;
  if (stats.finished_shards > 0) {
    text = fmt::format("{} of {} shards were gathered before and skipped\n", stats.finished_shards,
                       stats.finished_shards + stats.gathered_shards);
  }
  if (arguments.shard) {
    text += fmt::format("shard {} of {} of ", arguments.shard->first, arguments.shard->count);
  }
  return text;
}

// Options that only count beside others.
void noteUnusedOptions(const GatherOptions& options, Progress& progress) {
  const GatherWeights& weights = options.weights;
  const GatherEnvironment& environment = options.environment;
  const auto note = [&](bool is_unused, const char* option, const char* needed) {
    if (is_unused) progress.note(fmt::format("{} has no effect without {}", option, needed));
  };
  const bool is_glossy = options.mode == GatherMode::kGlossy;
  note(!is_glossy && weights.roughness != GatherWeights{}.roughness, "--roughness",
       "--mode glossy");
  note(!is_glossy && !std::isnan(options.eye.x), "--camera", "--mode glossy");
  note(weights.falloff == 0 && weights.falloff_mode != GatherWeights{}.falloff_mode,
       "--falloff-mode", "--falloff");
  note(environment.path.empty() && environment.rotation != 0, "--environment-rotation",
       "--environment");
  note(environment.path.empty() && environment.intensity != 1, "--environment-intensity",
       "--environment");
  note(options.quality.max_variation == 0 && options.quality.max_pixel_distance > 0,
       "--max-pixel-dist", "--max-variation");
}

Status runGather(GatherArguments& arguments, CommandContext& context) {
  GatherOptions& options = arguments.options;
  noteUnusedOptions(options, context.progress());
  options.threads = context.threads();
  options.strict = context.common.strict;
  options.memory_bytes = context.common.memory_bytes;
  SURFEIT_RETURN_IF_ERROR(expandStage(options));
  if (arguments.is_dry_run) return sayForecast(arguments, context);
  SURFEIT_ASSIGN_OR_RETURN(const ShardStats stats, gatherAsAsked(arguments, context));
  const double rate = double(stats.receivers) / std::max(stats.gather_seconds, 1e-9);
  context.say(fmt::format(
      "{}{}: {} receivers in {:.1f} s, {} receivers/s with {} threads\n"
      "memory: budget {}, peak resident {}, temporary files {}\n{}",
      describeShards(arguments, stats), arguments.result, formatCount(stats.receivers),
      context.wallSeconds(), formatCount(static_cast<std::uint64_t>(rate)), stats.threads,
      formatBytes(stats.memory_bytes), formatBytes(peakResidentBytes()),
      formatBytes(stats.temporary_bytes), stats.receivers > 0 ? cacheTable(stats) : std::string()));
  if (options.quality.max_variation > 0) {
    context.say(fmt::format("{} of them interpolated", formatCount(stats.interpolated_receivers)));
  }
  if (!options.stage_directory.empty()) {
    context.say(fmt::format("stage: {} read there, {} kept", formatBytes(stats.staged_bytes_read),
                            formatBytes(stats.staged_bytes_kept)));
  }
  if (!arguments.series.empty()) {
    SURFEIT_RETURN_IF_ERROR(writeCacheSeries(arguments.series, stats.windows));
  }
  return context.writeStats({{"command", "gather"},
                             {"mode", modeName(options.mode)},
                             {"outputs", describeOutputs(stats.outputs)},
                             {"max_solid_angle", options.quality.max_solid_angle},
                             {"raster_resolution", options.quality.raster_resolution},
                             {"near_field_radii", options.quality.near_field_radii},
                             {"max_variation", options.quality.max_variation},
                             {"memory_bytes", stats.memory_bytes},
                             {"receivers", stats.receivers},
                             {"invalid_receivers", stats.invalid_receivers},
                             {"interpolated_receivers", stats.interpolated_receivers},
                             {"gathered_shards", stats.gathered_shards},
                             {"finished_shards", stats.finished_shards},
                             {"receivers_per_second", rate},
                             {"gather_seconds", stats.gather_seconds},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"staged_bytes_read", stats.staged_bytes_read},
                             {"staged_bytes_kept", stats.staged_bytes_kept},
                             {"node_cache", cacheJson(stats.node_cache)},
                             {"surfel_cache", cacheJson(stats.surfel_cache)},
                             {"windows", windowsJson(stats.windows)}});
}

void addShardOptions(CLI::App& command, GatherArguments& arguments) {
  constexpr const char* kGroup = "Many machines";
  CLI::Option* const shard =
      command
          .add_option_function<std::string>(
              "--shard", [&](const std::string& text) { arguments.shard = parseShard(text); },
              "Gather the I-th of N parts of the receivers alone, into a file beside CLOUD; "
              "`surfeit merge` makes the result (docs/farm.md)")
          ->type_name("I/N")
          ->group(kGroup);
  CLI::Option* const resume =
      command
          .add_flag("--resume", arguments.resumes,
                    "Gather part by part; go on where a run of the same command was stopped")
          ->excludes(shard)
          ->group(kGroup);
  command
      .add_option("--resume-parts", arguments.resumed_shards,
                  "Parts of --resume; a run that is stopped loses no more than one (default: up to "
                  "64, of 32,768 receivers or more)")
      ->check(CLI::Range(1, kMostShards))
      ->needs(resume)
      ->group(kGroup);
}

}  // namespace

void addGatherCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "gather", "Gather occlusion, color bleeding, reflection or environment light at receivers");
  const auto arguments = std::make_shared<GatherArguments>();
  command->add_option("SCENE", arguments->scene, "Scene file (.sft)")->required();
  command
      ->add_option("RECEIVERS", arguments->receivers,
                   "Cloud with x y z and nx ny nz, passes (.exr) or volumes (.vdb); docs/files.md")
      ->required();
  addCloudOutputOption(*command, arguments->result, "Result cloud", true);
  addGatherOptions(*command, arguments->options);
  addStageOptions(*command, arguments->options);
  addLightOptions(*command, arguments->options);
  addSubsetOption(*command, arguments->options.groups, arguments->scene);
  addGainOption(*command, arguments->options.gains, arguments->scene);
  command->add_option("--cache-series", arguments->series,
                      "Write statistics of the caches over time to this file, .csv or .json");
  command->add_flag("--dry-run", arguments->is_dry_run,
                    "Write no result; estimate memory, files and time from a sample");
  addShardOptions(*command, *arguments);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "The result holds the receivers in their order with all their properties, and `occlusion`;\n"
      "with --mode bleeding also `irradiance_r irradiance_g irradiance_b`, with --mode glossy\n"
      "`reflection_r reflection_g reflection_b`, with --environment also `environment_r ...`;\n"
      "--outputs chooses others. Lights are in units of radiosity: a surface reflects albedo "
      "times\n"
      "them.\n"
      "Examples:\n"
      "  surfeit gather lion.sft lion.ply -o lion_ao.ply\n"
      "  surfeit gather city.sft street.ply -o street_gi.ply --mode bleeding --memory 2G\n"
      "  surfeit gather city.sft street.ply -o look.ply --quality draft\n"
      "  surfeit gather city.sft street.ply -o street_gi.ply --mode bleeding --dry-run\n"
      "  surfeit gather lion.sft lion.ply -o lit.ply --environment sky.exr \\\n"
      "      --outputs occlusion,bent_normal,environment\n"
      "  surfeit gather hall.sft floor.ply -o mirror.ply --mode glossy --roughness 0.05 \\\n"
      "      --camera 2,-6,1.7\n"
      "  surfeit gather hall.sft walls.ply -o ao.ply --max-dist 2 --falloff 1 \\\n"
      "      --falloff-mode polynomial\n"
      "  surfeit gather city.sft street.ply -o neon.ply --mode bleeding --subset 0,2-5\n"
      "  surfeit gather city.sft street.ply -o street_ao.ply --memory 512M --direct-io \\\n"
      "      --cache-series paging.csv\n"
      "  surfeit gather city.sft street.ply -o street_ao.ply --shard 3/16  # then surfeit merge\n"
      "  surfeit gather city.sft street.ply -o street_ao.ply --resume");
  command->callback(
      [arguments, &context] { context.run([&] { return runGather(*arguments, context); }); });
}

}  // namespace surfeit
