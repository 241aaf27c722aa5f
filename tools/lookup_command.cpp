// surfeit lookup: baked values at receivers.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "surfeit/lookup.h"
#include "surfeit/process.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/gather_options.h"
#include "tools/matrix_option.h"
#include "tools/number_checks.h"

namespace surfeit {
namespace {

struct LookupArguments {
  std::string map, receivers, result;
  LookupOptions options;
  bool is_dry_run = false;
};

Status runLookup(LookupArguments& arguments, CommandContext& context) {
  LookupOptions& options = arguments.options;
  options.threads = context.common.threads;
  options.strict = context.common.strict;
  options.memory_bytes = context.common.memory_bytes;
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(const SampleForecast forecast,
                             forecastLookup(arguments.map, arguments.receivers, arguments.result,
                                            options, context.progress()));
    return sayForecast("lookup", "receivers", arguments.result, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(const LookupStats stats,
                           lookupCloud(arguments.map, arguments.receivers, arguments.result,
                                       options, context.progress()));
  const double seconds = std::max(context.wallSeconds(), 1e-9);
  const std::uint64_t without = stats.missing_receivers + stats.invalid_receivers;
  context.say(fmt::format(
      "{}: {} of {} receivers have values, from {}\n"
      "{:.1f} s ({}), {} receivers/s, peak memory {}, temporary files {}",
      arguments.result, formatCount(stats.receivers - without), formatCount(stats.receivers),
      stats.is_brick_map ? "a brick map" : formatCount(stats.points) + " points", seconds,
      formatPhases(stats.phase_seconds),
      formatCount(static_cast<std::uint64_t>(double(stats.receivers) / seconds)),
      formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "lookup"},
                             {"memory_bytes", stats.memory_bytes},
                             {"map", stats.is_brick_map ? "brick" : "cloud"},
                             {"channels", stats.channels},
                             {"points", stats.points},
                             {"skipped_points", stats.skipped_points},
                             {"spacing", stats.spacing},
                             {"max_distance", stats.max_distance},
                             {"receivers", stats.receivers},
                             {"invalid_receivers", stats.invalid_receivers},
                             {"missing_receivers", stats.missing_receivers},
                             {"page_loads", stats.page_loads},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"receivers_per_second", double(stats.receivers) / seconds},
                             {"phases", jsonOfPhases(stats.phase_seconds)}});
}

void addMapOptions(CLI::App& command, LookupOptions& options) {
  constexpr const char* kGroup = "Map";
  command
      .add_option("--channel", options.values,
                  "Channels or properties that receivers get, separated by commas (default: all of "
                  "a brick map; of a cloud the outputs of a gather, else all but the geometry)")
      ->delimiter(',')
      ->allow_extra_args(false)  // else it takes the receivers behind it, too
      ->type_name("NAME")
      ->group(kGroup);
  addChoice<LookupInterpolation>(
      command, "--interpolation", options.interpolation,
      "Value from points of a cloud: the 8 nearest weighted by "
      "distance, or the nearest; voxels are interpolated linearly",
      {{"smooth", LookupInterpolation::kSmooth}, {"nearest", LookupInterpolation::kNearest}})
      ->group(kGroup);
  command
      .add_option("--max-distance", options.max_distance,
                  "Points of a cloud farther away do not count (default: 8 times their spacing)")
      ->check(kPositiveNumber.description(""))
      ->type_name("D")
      ->default_str("")
      ->group(kGroup);
  command
      .add_option("--filter-width", options.filter_width,
                  "Width to average over in a brick map (default: its finest voxels)")
      ->check(kNonNegativeNumber.description(""))
      ->type_name("W")
      ->default_str("")
      ->group(kGroup);
  command.add_option("--missing", options.missing, "What receivers get that find no value nearby")
      ->type_name("NUMBER")
      ->default_str("nan")
      ->group(kGroup);
  command.add_option("--map-channels", options.map_channels, "New names for channels of a cloud")
      ->type_name("FROM=TO,...")
      ->group(kGroup);
  command
      .add_option("--map-filter", options.map_filter,
                  "Take only points of a cloud for which this holds")
      ->type_name("CONDITION")
      ->group(kGroup);
}

void addSpaceOptions(CLI::App& command, LookupOptions& options) {
  constexpr const char* kGroup = "Objects that move";
  const auto addSpace = [&](const char* name, LookupMatrix& matrix, const char* help) {
    command
        .add_option_function<std::string>(
            name, [name, &matrix](const std::string& text) { matrix = parseMatrix(name, text); },
            help)
        ->type_name("\"16 numbers\"|FILE")
        ->group(kGroup);
  };
  addSpace("--from-space", options.from_space,
           "Where the object is now: the matrix from its own space to that of the receivers");
  addSpace("--to-space", options.to_space,
           "Where it was when values were baked: the matrix from its own space to that of the map");
  command
      .add_option("--pref", options.reference_positions,
                  "Look up at this channel of reference positions, such as Pref: for what deforms")
      ->type_name("NAME")
      ->group(kGroup);
  command
      .add_option("--nref", options.reference_normals,
                  "The normals there, such as Nref (default: any surface counts)")
      ->type_name("NAME")
      ->group(kGroup);
}

}  // namespace

void addLookupCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("lookup", "Look up baked values of a brick map or a cloud at receivers");
  const auto arguments = std::make_shared<LookupArguments>();
  command
      ->add_option("MAP", arguments->map,
                   "Brick map (surfeit brick), or a cloud with baked values (docs/files.md)")
      ->required();
  command
      ->add_option("RECEIVERS", arguments->receivers,
                   "Cloud with x y z and nx ny nz, passes (.exr) or volumes (.vdb)")
      ->required();
  addCloudOutputOption(*command, arguments->result, "Result cloud", true);
  addMapOptions(*command, arguments->options);
  addSpaceOptions(*command, arguments->options);
  LookupOptions& options = arguments->options;
  addChannelOptions(*command, options.channels, options.part, options.filter);
  addColorRangeOption(*command, options.color_range);
  addTemporaryOption(*command, options.temporary_directory);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  command->footer(
      "The result holds the receivers in their order with all their properties, and the values.\n"
      "Values count whose surface faces as the receiver does. --memory defaults to 1G, or 3/4 of\n"
      "what the job may hold where that is less.\n"
      "Examples:\n"
      "  surfeit lookup light.vdb frame7.ply -o lit7.ply\n"
      "  surfeit lookup baked.ply passes.exr -o light.exr --channel irradiance\n"
      "  surfeit lookup hero_ao.ptc hero7.ply -o ao7.ply --interpolation nearest \\\n"
      "      --from-space \"1 0 0 4  0 1 0 0  0 0 1 0  0 0 0 1\" --missing 0\n"
      "  surfeit lookup hero_ao.ptc bent7.ply -o ao7.ply --pref Pref --nref Nref");
  command->callback(
      [arguments, &context] { context.run([&] { return runLookup(*arguments, context); }); });
}

}  // namespace surfeit
