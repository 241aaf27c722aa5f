// surfeit gather: occlusion and color bleeding at receivers.
#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>

#include "core/job_limits.h"
#include "surfeit/gather.h"
#include "tools/command.h"

namespace surfeit {
namespace {

struct GatherArguments {
  std::string scene, receivers, result;
  GatherOptions options;
};

nlohmann::json cacheJson(const GatherCacheStats& cache) {
  return {{"requests", cache.requests},
          {"hits", cache.hits},
          {"misses", cache.misses},
          {"evictions", cache.evictions},
          {"bytes_read", cache.bytes_read},
          {"peak_bytes", cache.peak_bytes},
          {"budget_bytes", cache.budget_bytes},
          {"decoded_bytes", cache.decoded_bytes}};
}

std::string cacheRow(const char* name, const GatherCacheStats& cache) {
  const double rate =
      cache.requests > 0 ? 100.0 * double(cache.hits) / double(cache.requests) : 100;
  return fmt::format("  {:8}{:>18}{:>11.4f}{:>14}{:>14}{:>12}{:>12}{:>12}", name,
                     formatCount(cache.requests), rate, formatCount(cache.misses),
                     formatCount(cache.evictions), formatBytes(cache.bytes_read),
                     formatBytes(cache.peak_bytes), formatBytes(cache.decoded_bytes));
}

Status runGather(GatherArguments& arguments, CommandContext& context) {
  GatherOptions& options = arguments.options;
  options.threads = context.threads();
  options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(const GatherStats stats,
                           gatherCloud(arguments.scene, arguments.receivers, arguments.result,
                                       options, context.progress()));
  const double rate = double(stats.receivers) / std::max(stats.gather_seconds, 1e-9);
  context.say(
      fmt::format("{}: {} receivers in {:.1f} s, {} receivers/s with {} threads\n"
                  "memory: budget {}, peak resident {}\n"
                  "  {:8}{:>18}{:>11}{:>14}{:>14}{:>12}{:>12}{:>12}\n{}\n{}",
                  arguments.result, formatCount(stats.receivers), context.wallSeconds(),
                  formatCount(static_cast<std::uint64_t>(rate)), stats.threads,
                  formatBytes(stats.memory_bytes), formatBytes(peakResidentBytes()), "cache",
                  "requests", "hits %", "misses", "evictions", "read", "peak", "decoded",
                  cacheRow("nodes", stats.node_cache), cacheRow("surfels", stats.surfel_cache)));
  return context.writeStats(
      {{"command", "gather"},
       {"mode", options.mode == GatherMode::kBleeding ? "bleeding" : "occlusion"},
       {"max_solid_angle", options.quality.max_solid_angle},
       {"raster_resolution", options.quality.raster_resolution},
       {"memory_bytes", stats.memory_bytes},
       {"receivers", stats.receivers},
       {"invalid_receivers", stats.invalid_receivers},
       {"receivers_per_second", rate},
       {"gather_seconds", stats.gather_seconds},
       {"node_cache", cacheJson(stats.node_cache)},
       {"surfel_cache", cacheJson(stats.surfel_cache)}});
}

void addQualityOptions(CLI::App& command, GatherQuality& quality) {
  constexpr const char* kGroup = "Quality";
  command
      .add_option("--max-solid-angle,--maxsolidangle", quality.max_solid_angle,
                  "Largest cluster drawn as one, in steradians; 0 opens all")
      ->check(CLI::Range(0.0, 6.3))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--raster-resolution,--rasterresolution", quality.raster_resolution,
                  "Pixels along a cube face, even, 2 to 64")
      ->check(CLI::Range(2, 64))
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--bias", quality.bias, "Start of rays above the receiver, in surfel radii")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--near-field", quality.near_field_radii,
                  "Surfels closer than this many radii are ray traced")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--max-dist,--maxdist", quality.max_distance,
                  "Surfels farther away do not count, in scene units")
      ->check(CLI::PositiveNumber)
      ->group(kGroup);
  command.add_option("--sides", quality.sides, "Sides of surfels that cover: front or both")
      ->transform(CLI::CheckedTransformer(std::map<std::string, GatherSides>{
          {"front", GatherSides::kFront}, {"both", GatherSides::kBoth}}))
      ->default_str("front")
      ->group(kGroup);
}

}  // namespace

void addGatherCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("gather", "Gather occlusion or color bleeding at receivers");
  const auto arguments = std::make_shared<GatherArguments>();
  command->add_option("SCENE", arguments->scene, "Scene file (.sft)")->required();
  command->add_option("RECEIVERS", arguments->receivers, "Cloud (PLY) with x y z and nx ny nz")
      ->required();
  command->add_option("-o,--output", arguments->result, "Result cloud (PLY)")->required();
  command->add_option("--mode", arguments->options.mode, "occlusion or bleeding")
      ->transform(CLI::CheckedTransformer(std::map<std::string, GatherMode>{
          {"occlusion", GatherMode::kOcclusion}, {"bleeding", GatherMode::kBleeding}}))
      ->default_str("occlusion");
  command->add_flag("--strict", arguments->options.strict,
                    "Refuse invalid receivers instead of writing NaN for them");
  addQualityOptions(*command, arguments->options.quality);
  context.addCommonOptions(*command);
  command->footer(
      "The result holds the receivers in their order with all their properties, and `occlusion`;\n"
      "with --mode bleeding also `irradiance_r irradiance_g irradiance_b`.\n"
      "Examples:\n"
      "  surfeit gather lion.sft lion.ply -o lion_ao.ply\n"
      "  surfeit gather city.sft street.ply -o street_gi.ply --mode bleeding --memory 2G");
  command->callback(
      [arguments, &context] { context.run([&] { return runGather(*arguments, context); }); });
}

}  // namespace surfeit
