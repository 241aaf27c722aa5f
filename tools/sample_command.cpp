// surfeit sample: triangle meshes to a surfel cloud with direct light, or to a photon map.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "surfeit/sample.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/sample_options.h"

namespace surfeit {
namespace {

nlohmann::json jsonOf(const glm::dvec3& rgb) { return {rgb.r, rgb.g, rgb.b}; }

Status runPhotons(const SampleArguments& arguments, CommandContext& context) {
  PhotonTracingOptions options;
  options.surroundings = arguments.options.surroundings;
  options.photons = arguments.photons;
  options.seed = arguments.photon_seed;
  options.caustic_output = arguments.caustic_output;
  options.threads = context.threads();
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastPhotons(arguments.meshes, arguments.output, options, context.progress()));
    return sayForecast("sample", "photons", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const PhotonTracingStats stats,
      tracePhotons(arguments.meshes, arguments.output, options, context.progress()));
  context.say(fmt::format("{}: {} photons stored of {} sent in {:.1f} s ({:.2f} M photons/s)",
                          arguments.output, formatCount(stats.stored), formatCount(stats.emitted),
                          context.wallSeconds(),
                          double(stats.emitted) / std::max(stats.trace_seconds, 1e-9) / 1e6));
  if (!options.caustic_output.empty()) {
    context.say(fmt::format("{}: {} photons of caustics", options.caustic_output,
                            formatCount(stats.caustic)));
  }
  if (stats.lost_at_backs * 20 > stats.emitted) {
    context.say(
        fmt::format("warning: {} photons met the back of a surface, which is black: do "
                    "normals point the right way?",
                    formatCount(stats.lost_at_backs)));
  }
  return context.writeStats({{"command", "sample"},
                             {"triangles", stats.triangles},
                             {"degenerate_faces", stats.degenerate_faces},
                             {"emitted_photons", stats.emitted},
                             {"stored_photons", stats.stored},
                             {"caustic_photons", stats.caustic},
                             {"caustic_power", jsonOf(stats.caustic_power)},
                             {"escaped_photons", stats.escaped},
                             {"photons_lost_at_backs", stats.lost_at_backs},
                             {"emitted_power", jsonOf(stats.emitted_power)},
                             {"stored_power", jsonOf(stats.stored_power)},
                             {"phases",
                              {{"load", stats.load_seconds},
                               {"build", stats.build_seconds},
                               {"trace", stats.trace_seconds}}}});
}

Status runSample(SampleArguments& arguments, CommandContext& context) {
  if (arguments.photons > 0) return runPhotons(arguments, context);
  arguments.options.threads = context.threads();
  SURFEIT_ASSIGN_OR_RETURN(arguments.options.density, arguments.cameras.cameraDensity());
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastSample(arguments.meshes, arguments.output, arguments.options, context.progress()));
    return sayForecast("sample", "surfels", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const SampleStats stats,
      sampleMeshes(arguments.meshes, arguments.output, arguments.options, context.progress()));
  context.say(fmt::format("{}: {} surfels from {} triangles in {:.1f} s ({:.2f} M surfels/s)",
                          arguments.output, formatCount(stats.surfels),
                          formatCount(stats.triangles), context.wallSeconds(),
                          double(stats.surfels) / std::max(stats.sample_seconds, 1e-9) / 1e6));
  return context.writeStats({{"command", "sample"},
                             {"triangles", stats.triangles},
                             {"degenerate_faces", stats.degenerate_faces},
                             {"surfels", stats.surfels},
                             {"sliver_surfels", stats.sliver_surfels},
                             {"clear_surfels", stats.clear_surfels},
                             {"area", stats.area},
                             {"surfel_area", stats.surfel_area},
                             {"disk_area", stats.disk_area},
                             {"spacing", stats.spacing},
                             {"phases",
                              {{"load", stats.load_seconds},
                               {"build", stats.build_seconds},
                               {"sample", stats.sample_seconds}}}});
}

}  // namespace

void addSampleCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("sample", "Turn triangle meshes into surfels with direct light");
  const auto arguments = std::make_shared<SampleArguments>();
  addSampleOptions(*command, *arguments);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command, {.threads = true, .stats = true});
  context.addFrameOptions(*command);
  command->footer(
      "Meshes are held in memory, some 100 bytes per triangle; meshes that exceed --memory are\n"
      "refused.\n"
      "Examples:\n"
      "  surfeit sample cornell.obj -o cornell.ply --count 1000000\n"
      "  surfeit sample lion.ply -o lion.ply --spacing 0.01 --ground-plane --up z \\\n"
      "      --light-directional \"-1 -1 -2  3 3 3\"\n"
      "  surfeit sample city.obj -o shot.ply --camera \"12 2 40  12 4 0  50\" --size 2048x1024 \\\n"
      "      --pixels 1.5\n"
      "  surfeit sample cornell.obj -o photons.ply --photons 1000000");
  command->callback(
      [arguments, &context] { context.run([&] { return runSample(*arguments, context); }); });
}

}  // namespace surfeit
