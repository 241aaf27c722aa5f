// surfeit bounce: several bounces of light between the surfels of a scene.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "surfeit/bounce.h"
#include "surfeit/process.h"
#include "tools/cache_report.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/gather_options.h"
#include "tools/look_options.h"

namespace surfeit {
namespace {

struct BounceArguments {
  std::string scene, result;
  BounceOptions options;
  GroupLookArguments of_groups;
  bool is_dry_run = false;
};

nlohmann::json passJson(const BouncePass& pass) {
  return {{"receivers", pass.receivers},
          {"gather_seconds", pass.gather_seconds},
          {"write_seconds", pass.write_seconds},
          {"mean_radiosity", {pass.mean_radiosity.r, pass.mean_radiosity.g, pass.mean_radiosity.b}},
          {"largest_change", pass.largest_change},
          {"node_cache", cacheJson(pass.node_cache)},
          {"surfel_cache", cacheJson(pass.surfel_cache)}};
}

nlohmann::json glossyJson(const std::vector<GroupGloss>& glossy) {
  nlohmann::json json = nlohmann::json::array();
  for (const GroupGloss& of : glossy) {
    json.push_back({{"group", of.group}, {"share", of.share}, {"roughness", of.roughness}});
  }
  return json;
}

std::string passLine(std::size_t bounce, const BouncePass& pass) {
  return fmt::format(
      "bounce {}: {:.1f} s and {:.1f} s to write, {} receivers/s; mean radiosity {:.4g} {:.4g} "
      "{:.4g}, largest change {:.3g}\n",
      bounce, pass.gather_seconds, pass.write_seconds,
      formatCount(
          static_cast<std::uint64_t>(double(pass.receivers) / std::max(pass.gather_seconds, 1e-9))),
      pass.mean_radiosity.r, pass.mean_radiosity.g, pass.mean_radiosity.b, pass.largest_change);
}

Status runBounce(BounceArguments& arguments, CommandContext& context) {
  BounceOptions& options = arguments.options;
  options.threads = context.threads();
  options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(options.group_corrections,
                           arguments.of_groups.corrections(arguments.scene));
  SURFEIT_ASSIGN_OR_RETURN(options.glossy, arguments.of_groups.gloss(arguments.scene));
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastBounce(arguments.scene, arguments.result, options, context.progress()));
    return sayForecast("bounce", "surfels", arguments.result, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(const BounceStats stats, bounceScene(arguments.scene, arguments.result,
                                                                options, context.progress()));
  std::string lines;
  nlohmann::json passes = nlohmann::json::array();
  for (const BouncePass& pass : stats.passes) {
    passes.push_back(passJson(pass));
    lines += passLine(passes.size(), pass);
  }
  context.say(
      fmt::format("{}: {} surfels, {}, in {:.1f} s with {} threads\n{}"
                  "memory: budget {}, peak resident {}, temporary files {}",
                  arguments.result, formatCount(stats.surfels), formatBytes(stats.file_bytes),
                  context.wallSeconds(), stats.threads, lines, formatBytes(stats.memory_bytes),
                  formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "bounce"},
                             {"bounces", options.bounces},
                             {"surfels_per_receiver", options.surfels_per_receiver},
                             {"spare_last", options.spare_last},
                             {"glossy", glossyJson(options.glossy)},
                             {"max_solid_angle", options.quality.max_solid_angle},
                             {"raster_resolution", options.quality.raster_resolution},
                             {"near_field_radii", options.quality.near_field_radii},
                             {"memory_bytes", stats.memory_bytes},
                             {"surfels", stats.surfels},
                             {"file_bytes", stats.file_bytes},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"passes", passes}});
}

}  // namespace

void addBounceCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "bounce", "Let light bounce between the surfels of a scene: B = B0 + albedo * E");
  const auto arguments = std::make_shared<BounceArguments>();
  BounceOptions& options = arguments->options;
  command
      ->add_option("SCENE", arguments->scene,
                   "Scene file (.sft) with albedo; its radiosity is emission and direct light")
      ->required();
  command->add_option("-o,--output", arguments->result, "Scene file to write (.sft)")->required();
  command->add_option("--bounces", options.bounces, "Number of bounces")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  CLI::Option* const spared =
      command
          ->add_option(
              "--surfels-per-receiver", options.surfels_per_receiver,
              "Gather all bounces but the last at about one surfel out of N, and interpolate; "
              "1: at every surfel")
          ->check(CLI::Range(1, 64))
          ->capture_default_str();
  command
      ->add_flag("--spare-last", options.spare_last,
                 "Gather the last bounce at one surfel out of N, too")
      ->needs(spared);
  addQualityOptions(*command, options.quality);
  addSubsetOption(*command, options.groups, arguments->scene);
  addLookOptions(*command, options.look);
  addGroupLookOptions(*command, arguments->of_groups);
  addCacheOptions(*command, options.cache_split, options.direct_io);
  addTemporaryOption(*command, options.temporary_directory)->group("Paging");
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "The result holds the same surfels, pages and nodes with new radiosities. A gather from it\n"
      "adds one more bounce at its receivers: after --bounces 1, --mode bleeding shows two.\n"
      "With --glossy surfels send a part of what they reflect in a lobe: a shiny floor throws a\n"
      "bright patch onto the wall. What shines there must be surfels, sampled with --emission.\n"
      "A scene without albedo is refused: index clouds with albedo_r albedo_g albedo_b, which\n"
      "surfeit sample writes.\n"
      "Examples:\n"
      "  surfeit bounce cornell.sft -o cornell_b2.sft --bounces 2\n"
      "  surfeit bounce city.sft -o city_b3.sft --bounces 3 --surfels-per-receiver 8 --memory 2G\n"
      "  surfeit bounce city.sft -o look.sft --quality draft --stats bounce.json\n"
      "  surfeit bounce hall.sft -o shiny.sft --bounces 2 --glossy floor=.8,.2\n"
      "  surfeit bounce room.sft -o warm.sft --bounce-gain 1.2 --group-saturation curtain=.4 \\\n"
      "      --bounce-filter \"centre=0,1,2 radius=1,3 gain=.5 tint=1,.9,.8\"");
  command->callback(
      [arguments, &context] { context.run([&] { return runBounce(*arguments, context); }); });
}

}  // namespace surfeit
