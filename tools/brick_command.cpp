// surfeit brick: baked values of clouds to a multiresolution OpenVDB file.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "surfeit/brick.h"
#include "surfeit/process.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/number_checks.h"

namespace surfeit {
namespace {

struct BrickArguments {
  std::vector<std::string> clouds;
  std::string output;
  std::vector<std::string> unused;  // words of brickmake without a meaning here
  BrickOptions options;
  bool is_dry_run = false;
};

Status runBrick(BrickArguments& arguments, CommandContext& context) {
  BrickOptions& options = arguments.options;
  options.threads = context.common.threads;
  options.strict = context.common.strict;
  options.memory_bytes = context.common.memory_bytes;
  for (const std::string& word : arguments.unused) context.progress().note(word);
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastBrick(arguments.clouds, arguments.output, options, context.progress()));
    return sayForecast("brick", "points", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(const BrickStats stats, brickClouds(arguments.clouds, arguments.output,
                                                               options, context.progress()));
  const double seconds = std::max(context.wallSeconds(), 1e-9);
  const std::uint64_t voxels =
      std::accumulate(stats.level_voxels.begin(), stats.level_voxels.end(), std::uint64_t{0});
  context.say(fmt::format(
      "{}: {} voxels in {} levels of {:.4g} to {:.4g}, {}\n"
      "{:.1f} s, {:.2f} M points/s, peak memory {}, temporary files {}",
      arguments.output, formatCount(voxels), stats.level_voxels.size(), stats.voxel_size,
      stats.voxel_size * double(std::uint64_t{1} << (stats.level_voxels.size() - 1)),
      formatBytes(stats.file_bytes), seconds, double(stats.points) / seconds / 1e6,
      formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "brick"},
                             {"memory_bytes", stats.memory_bytes},
                             {"max_error", options.max_error},
                             {"points", stats.points},
                             {"skipped_points", stats.skipped_points},
                             {"channels", stats.channels},
                             {"voxel_size", stats.voxel_size},
                             {"voxels", voxels},
                             {"level_voxels", stats.level_voxels},
                             {"file_bytes", stats.file_bytes},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"points_per_second", double(stats.points) / seconds},
                             {"phases", jsonOfPhases(stats.phase_seconds)}});
}

void addBrickOptions(CLI::App& command, BrickOptions& options) {
  command
      .add_option("--channel", options.channels,
                  "Channels or properties to keep, separated by commas (default: the outputs of a "
                  "gather, else all channels but the geometry)")
      ->delimiter(',')
      ->allow_extra_args(false)  // else it takes the clouds behind it, too
      ->type_name("NAME");
  command
      .add_option("--max-error", options.max_error,
                  "Divide a voxel where a value differs by more than this within it, in the units "
                  "of the channel; 0 keeps all voxels of the finest level")
      ->type_name("E")
      ->check(kNonNegativeNumber.description(""))
      ->capture_default_str();
  command
      .add_option("--voxel-size", options.voxel_size,
                  "Edge of the finest voxels, scene units (default: twice the spacing of the "
                  "points)")
      ->type_name("S")
      ->check(kPositiveNumber.description(""));
  addFilterOption(command, options.filter);
  addColorRangeOption(command, options.color_range);
  addTemporaryOption(command, options.temporary_directory);
}

void addMapOption(CLI::App& command, std::string& output, const std::string& description) {
  command.add_option("-o,--output", output, description)
      ->required()
      ->check(
          [](const std::string& name) {
            if (name.ends_with(".vdb")) return std::string();
            return std::string("expected a name that ends with .vdb: brick maps are OpenVDB files");
          },
          "");
}

// A word of brickmake that changes nothing.
void addUnusedWord(CLI::App& command, const std::string& name, const std::string& reason,
                   std::vector<std::string>& unused) {
  command
      .add_option_function<std::string>(
          "--" + name,
          [=, &unused](const std::string& value) {
            unused.push_back(fmt::format("-{} {}: {}: the word is ignored", name, value, reason));
          },
          reason)
      ->type_name("VALUE")
      ->group("Without a meaning here");
}

}  // namespace

void addBrickCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "brick", "Write baked values of clouds into a multiresolution OpenVDB file, for look-ups");
  const auto arguments = std::make_shared<BrickArguments>();
  command->add_option("CLOUD", arguments->clouds, "Clouds with baked values; several are merged")
      ->required();
  addMapOption(*command, arguments->output, "Brick map to write (.vdb)");
  addBrickOptions(*command, arguments->options);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  command->footer(
      "Values are looked up by position and normal: in programs with surfeit/brick.h, in pictures\n"
      "with surfeit view --brick (docs/brick.md).\n"
      "Examples:\n"
      "  surfeit gather scene.sft receivers.ply -o baked.ply --mode occlusion\n"
      "  surfeit brick baked.ply -o baked.vdb --max-error 0.02\n"
      "  surfeit brick left.ptc right.ptc -o light.vdb --channel irradiance,albedo \\\n"
      "      --voxel-size 0.05\n"
      "  surfeit view other.ply --brick baked.vdb -o other.png");
  command->callback(
      [arguments, &context] { context.run([&] { return runBrick(*arguments, context); }); });
}

// Command lines of RenderMan's brickmake.
void addBrickmakeCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("brickmake", "Command lines of RenderMan's brickmake: the same as brick");
  const auto arguments = std::make_shared<BrickArguments>();
  command->add_option("CLOUD", arguments->clouds, "Point clouds; several are merged")->required();
  addMapOption(*command, arguments->output, "The last word, or behind -o: brick map (.vdb)");
  command
      ->add_option("--maxerror", arguments->options.max_error,
                   "Divide a voxel where a value differs by more than this (brick --max-error)")
      ->check(kNonNegativeNumber.description(""))
      ->capture_default_str();
  addUnusedWord(*command, "maxdepth",
                "the finest voxels follow from the points (brick --voxel-size)", arguments->unused);
  addUnusedWord(*command, "radiusscale", "points count by their areas", arguments->unused);
  addTemporaryOption(*command, arguments->options.temporary_directory);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  command->footer(
      "Options have one dash or two, and the output is the last word; docs/renderman.md has the\n"
      "words.\n"
      "Examples:\n"
      "  surfeit brickmake -maxerror 0.002 wall.ptc wall.vdb");
  command->callback(
      [arguments, &context] { context.run([&] { return runBrick(*arguments, context); }); });
}

}  // namespace surfeit
