// surfeit normals: normals for clouds that have none.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "surfeit/normals.h"
#include "surfeit/process.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/normal_options.h"
#include "tools/up_option.h"

namespace surfeit {
namespace {

struct NormalsArguments {
  std::string input, output;
  NormalsOptions options;
  bool is_dry_run = false;
};

Status runNormals(NormalsArguments& arguments, CommandContext& context) {
  NormalsOptions& options = arguments.options;
  options.threads = context.common.threads;
  options.memory_bytes = context.common.memory_bytes;
  if (arguments.is_dry_run) {
    const auto run = [](const auto& samples, const auto& output, const auto& sampled,
                        Progress& progress) {
      return estimateNormals(samples[0], output, sampled, progress);
    };
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastOf({arguments.input}, arguments.output, options, run, context));
    return sayForecast("normals", "points", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const NormalsStats stats,
      estimateNormals(arguments.input, arguments.output, options, context.progress()));
  const double seconds = std::max(stats.seconds, 1e-9);
  context.say(fmt::format(
      "{}: normals of {} points, confidence {:.3f} on average\n"
      "{:.1f} s (order {:.1f} s), {:.2f} M points/s, peak memory {}, temporary files {}",
      arguments.output, formatCount(stats.points), stats.mean_confidence, seconds,
      stats.index_seconds, double(stats.points) / seconds / 1e6, formatBytes(peakResidentBytes()),
      formatBytes(stats.temporary_bytes)));
  return context.writeStats(
      {{"command", "normals"},
       {"memory_bytes", stats.memory_bytes},
       {"points", stats.points},
       {"points_without_surface", stats.without},
       {"points_outside_trajectory", stats.outside_trajectory},
       {"mean_confidence", stats.mean_confidence},
       {"temporary_bytes", stats.temporary_bytes},
       {"points_per_second", double(stats.points) / seconds},
       {"phases",
        {{"order", stats.index_seconds}, {"normals", stats.seconds - stats.index_seconds}}}});
}

void addNormalsOptions(CLI::App& command, NormalsOptions& options) {
  addNormalOptions(command, options.estimation);
  addUpOption(command, options.up, "Axis that is up", "as the cloud states, z for LAS, else y");
  command.add_flag("--sizes", options.with_sizes,
                   "Write the area, too, as index would find it (the radius follows there)");
  addChannelOptions(command, options.channels, options.part, options.filter);
  addColorRangeOption(command, options.color_range);
  addTemporaryOption(command, options.temporary_directory);
}

}  // namespace

void addNormalsCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("normals", "Estimate normals of a cloud that has none");
  const auto arguments = std::make_shared<NormalsArguments>();
  command->add_option("CLOUD", arguments->input, "Cloud of points, or a scene (.sft)")->required();
  addCloudOutputOption(*command, arguments->output, "Cloud to write, with all that CLOUD has");
  addNormalsOptions(*command, arguments->options);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  command->footer(
      "Writes nx ny nz and normal_confidence, from 0 (neighbours all around) to 1 (on a plane).\n"
      "Examples:\n"
      "  surfeit normals scan.las -o scan_normals.ply\n"
      "  surfeit normals statue.ply -o statue_normals.ply --orient consistent\n"
      "  surfeit normals room.ply -o room_normals.ply --orient \"sensor 2,3,1.6\" --thin "
      "two-sided\n"
      "  surfeit index scan_normals.ply -o scan.sft");
  command->callback(
      [arguments, &context] { context.run([&] { return runNormals(*arguments, context); }); });
}

}  // namespace surfeit
