// surfeit view: a picture of a cloud or of a paged octree file.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "tools/command.h"
#include "tools/view_options.h"
#include "view/view.h"

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
  context.say(fmt::format(
      "{}: channel {} of {} surfels in {:.1f} s; --eye \"{:.6g} {:.6g} {:.6g}\" "
      "--look-at \"{:.6g} {:.6g} {:.6g}\"",
      arguments.picture, stats.channel, formatCount(stats.records), stats.seconds, stats.eye.x,
      stats.eye.y, stats.eye.z, stats.look_at.x, stats.look_at.y, stats.look_at.z));
  return context.writeStats(statsOf(arguments, stats));
}

}  // namespace

void addViewCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("view", "Draw a cloud (.ply) or a scene (.sft)");
  const auto arguments = std::make_shared<ViewArguments>();
  command->add_option("FILE", arguments->input, "PLY cloud with x y z, or a .sft file")->required();
  command
      ->add_option("-o,--output", arguments->picture,
                   "Picture: .png (8-bit sRGB) or .exr (linear half RGBA, and Z)")
      ->required();
  addViewOptions(*command, arguments->options);
  context.addCommonOptions(*command);
  command->callback(
      [arguments, &context] { context.run([&] { return runView(*arguments, context); }); });
}

}  // namespace surfeit
