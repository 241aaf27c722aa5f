// surfeit view: a picture of a cloud or of a paged octree file.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "surfeit/view.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/view_options.h"

namespace surfeit {
namespace {

struct ViewArguments {
  std::string input, picture;
  ViewOptions options;
};

nlohmann::json statsOf(const ViewArguments& arguments, const ViewStats& stats) {
  return {
      {"command", "view"},
      {"input", arguments.input},
      {"picture", arguments.picture},
      {"passes", arguments.options.passes},
      {"pass_pixels", stats.pass_pixels},
      {"width", arguments.options.width},
      {"height", arguments.options.height},
      {"samples", arguments.options.samples},
      {"channel", stats.channel},
      {"records", stats.records},
      {"skipped_records", stats.skipped_records},
      {"drawn_surfels", stats.drawn_surfels},
      {"non_finite_values", stats.non_finite_values},
      {"coverage", stats.coverage},
      {"mean_estimated_radius", stats.mean_estimated_radius},
      {"eye", {stats.eye.x, stats.eye.y, stats.eye.z}},
      {"look_at", {stats.look_at.x, stats.look_at.y, stats.look_at.z}},
      {"framebuffer_bytes", stats.framebuffer_bytes},
      {"threads", stats.threads},
      {"seconds", stats.seconds},
  };
}

Status runView(ViewArguments& arguments, CommandContext& context) {
  arguments.options.threads = context.common.threads;
  arguments.options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(const ViewStats stats, viewCloud(arguments.input, arguments.picture,
                                                            arguments.options, context.progress()));
  const std::string camera = fmt::format(
      "--eye \"{:.10g} {:.10g} {:.10g}\" --look-at \"{:.10g} {:.10g} {:.10g}\"", stats.eye.x,
      stats.eye.y, stats.eye.z, stats.look_at.x, stats.look_at.y, stats.look_at.z);
  if (!arguments.options.passes.empty()) {
    context.say(fmt::format("{}: {} of {}x{} pixels see the cloud; {}", arguments.options.passes,
                            formatCount(stats.pass_pixels), arguments.options.width,
                            arguments.options.height, camera));
  }
  if (!arguments.picture.empty()) {
    context.say(fmt::format("{}: channel {} of {} surfels in {:.1f} s; {}", arguments.picture,
                            stats.channel, formatCount(stats.records), stats.seconds, camera));
  }
  return context.writeStats(statsOf(arguments, stats));
}

}  // namespace

void addViewCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command =
      app.add_subcommand("view", "Draw a cloud or a scene (.sft), or write its render passes");
  const auto arguments = std::make_shared<ViewArguments>();
  command->add_option("FILE", arguments->input, "Cloud with x y z, or a .sft file")->required();
  command->add_option("-o,--output", arguments->picture,
                      "Picture: .png (8-bit sRGB) or .exr (linear half RGBA, and Z)");
  command
      ->add_option("--passes", arguments->options.passes,
                   "Write position, normal, depth, albedo and radiosity of each pixel as OpenEXR: "
                   "receivers for gather. With or without -o")
      ->type_name("FILE");
  addChannelOptions(*command, arguments->options.channels, arguments->options.part,
                    arguments->options.filter);
  addColorRangeOption(*command, arguments->options.color_range);
  addViewOptions(*command, arguments->options);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "Examples:\n"
      "  surfeit view city.sft -o city.png --eye \"40 60 120\" --look-at \"0 10 0\" --size "
      "1920x1080\n"
      "  surfeit view baked.ptc -o bake.png --channels _bake=radiosity --exposure -1 --cull-back\n"
      "  surfeit view other.ply --brick baked.vdb --filter-width 0.1 -o other.png\n"
      "  surfeit view city.sft --passes passes.exr --size 1280x960");
  command->callback(
      [arguments, &context] { context.run([&] { return runView(*arguments, context); }); });
}

}  // namespace surfeit
