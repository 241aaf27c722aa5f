// surfeit radiance: a photon map to surfels with radiosity.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "surfeit/process.h"
#include "surfeit/radiance.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/number_checks.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

struct RadianceArguments {
  std::vector<std::string> photons;
  std::string output;
  RadianceOptions options;
  bool is_dry_run = false;
};

nlohmann::json jsonOf(const glm::dvec3& rgb) { return {rgb.r, rgb.g, rgb.b}; }

Status runRadiance(RadianceArguments& arguments, CommandContext& context) {
  RadianceOptions& options = arguments.options;
  options.threads = context.common.threads;
  options.strict = context.common.strict;
  options.memory_bytes = context.common.memory_bytes;
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastOf(arguments.photons, arguments.output, options, radianceCloud, context));
    return sayForecast("radiance", "photons", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const RadianceStats stats,
      radianceCloud(arguments.photons, arguments.output, options, context.progress()));
  const double seconds = std::max(context.wallSeconds(), 1e-9);
  context.say(
      fmt::format("{}: {} surfels, area {:.6g}, mean radius of an estimate {:.4g}\n"
                  "{:.1f} s ({}), {:.2f} M photons/s, peak memory {}, temporary files {}",
                  arguments.output, formatCount(stats.surfels), stats.area, stats.mean_radius,
                  seconds, formatPhases(stats.phase_seconds), double(stats.photons) / seconds / 1e6,
                  formatBytes(peakResidentBytes()), formatBytes(stats.temporary_bytes)));
  return context.writeStats({{"command", "radiance"},
                             {"memory_bytes", stats.memory_bytes},
                             {"photons_per_estimate", options.photons_per_estimate},
                             {"photons", stats.photons},
                             {"skipped_photons", stats.skipped_photons},
                             {"surfels", stats.surfels},
                             {"sparse_surfels", stats.sparse_surfels},
                             {"bounded_surfels", stats.bounded_surfels},
                             {"area", stats.area},
                             {"power", jsonOf(stats.power)},
                             {"reflected_power", jsonOf(stats.reflected_power)},
                             {"mean_radius", stats.mean_radius},
                             {"max_radius", stats.max_radius},
                             {"temporary_bytes", stats.temporary_bytes},
                             {"photons_per_second", double(stats.photons) / seconds},
                             {"phases", jsonOfPhases(stats.phase_seconds)}});
}

void addEstimateOptions(CLI::App& command, RadianceOptions& options) {
  command
      .add_option("--photons-per-estimate,--nphotons", options.photons_per_estimate,
                  "Nearest photons per estimate: more give less noise and more blur")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command
      .add_option("--max-radius", options.max_radius,
                  "Photons farther away do not count, in scene units (default: 16 times the median "
                  "radius)")
      ->check(kPositiveNumber);
  command
      .add_option_function<std::string>(
          "--albedo",
          [&options](const std::string& text) {
            const auto numbers = parseNumberList<3>("--albedo", text, "\"r g b\"");
            for (int i = 0; i < 3; ++i) options.default_albedo[i] = float(numbers[std::size_t(i)]);
          },
          "Reflectance of photons without albedo [\"0.5 0.5 0.5\"]")
      ->type_name("\"r g b\"");
  command
      .add_option("--disk-overlap", options.disk_overlap,
                  "Disk area over surfel area of the surfels written")
      ->check(CLI::Range(1.0, 16.0))
      ->capture_default_str();
}

}  // namespace

void addRadianceCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("radiance", "Turn a photon map into surfels with radiosity");
  const auto arguments = std::make_shared<RadianceArguments>();
  RadianceOptions& options = arguments->options;
  command
      ->add_option(
          "PHOTONS", arguments->photons,
          "Photon clouds (docs/photons.md: position, normal, power_r power_g power_b, albedo)")
      ->required();
  addCloudOutputOption(*command, arguments->output, "Cloud to write");
  addEstimateOptions(*command, options);
  addChannelOptions(*command, options.channels, options.part, options.filter);
  addColorRangeOption(*command, options.color_range);
  addTemporaryOption(*command, options.temporary_directory);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  command->footer(
      "The radiosity is reflected light: albedo times the power of the nearest photons over the\n"
      "area on which they lie. It is the input of final gathering. A .vdb is held in memory until\n"
      "it is written, in up to half of --memory.\n"
      "Examples:\n"
      "  surfeit sample cornell.obj -o photons.ply --photons 1000000\n"
      "  surfeit radiance photons.ply -o radiosity.ply --nphotons 100\n"
      "  surfeit radiance sun.ptc sky.ptc -o radiosity.bgeo.gz --channels _flux=power \\\n"
      "      --albedo \"0.3 0.3 0.3\" --max-radius 0.5 --memory 1G --temp /scratch\n"
      "  surfeit index radiosity.ply -o radiosity.sft\n"
      "  surfeit gather radiosity.sft receivers.ply -o result.ply --mode bleeding");
  command->callback(
      [arguments, &context] { context.run([&] { return runRadiance(*arguments, context); }); });
}

}  // namespace surfeit
