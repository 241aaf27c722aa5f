// surfeit sample: triangle meshes to a surfel cloud with direct light.
#include <fmt/format.h>

#include <memory>

#include "sample/sample.h"
#include "tools/command.h"
#include "tools/sample_options.h"

namespace surfeit {
namespace {

Status runSample(SampleArguments& arguments, CommandContext& context) {
  arguments.options.threads = context.threads();
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
                             {"area", stats.area},
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
  context.addCommonOptions(*command, {.threads = true, .memory = false, .stats = true});
  command->footer(
      "Examples:\n"
      "  surfeit sample cornell.obj -o cornell.ply --count 1000000\n"
      "  surfeit sample lion.ply -o lion.ply --spacing 0.01 --ground-plane --up z \\\n"
      "      --light-directional \"-1 -1 -2  3 3 3\"");
  command->callback(
      [arguments, &context] { context.run([&] { return runSample(*arguments, context); }); });
}

}  // namespace surfeit
