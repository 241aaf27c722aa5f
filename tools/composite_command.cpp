// surfeit composite: pictures from render passes and the light gathered at them.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "surfeit/composite.h"
#include "tools/command.h"
#include "tools/view_options.h"

namespace surfeit {
namespace {

struct CompositeArguments {
  std::vector<std::string> inputs;
  std::string picture;
  CompositeOptions options;
};

Status runComposite(CompositeArguments& arguments, CommandContext& context) {
  arguments.options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(
      const CompositeStats stats,
      compositePicture(arguments.inputs, arguments.picture, arguments.options, context.progress()));
  context.say(fmt::format("{}: channel {} of {} pixels", arguments.picture, stats.channel,
                          formatCount(stats.pixels)));
  return context.writeStats({{"command", "composite"},
                             {"inputs", arguments.inputs},
                             {"picture", arguments.picture},
                             {"width", stats.width},
                             {"height", stats.height},
                             {"channel", stats.channel},
                             {"pixels", stats.pixels},
                             {"non_finite_values", stats.non_finite_values}});
}

}  // namespace

void addCompositeCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "composite", "Make a picture of render passes and the light gathered at them (.exr)");
  const auto arguments = std::make_shared<CompositeArguments>();
  command
      ->add_option("FILES", arguments->inputs,
                   "OpenEXR pictures with positions: results of gather, and passes with the "
                   "channels that they lack")
      ->required();
  command
      ->add_option("-o,--output", arguments->picture,
                   "Picture: .png (8-bit sRGB) or .exr (linear half RGBA, and Z)")
      ->required();
  addCompositeOptions(*command, arguments->options);
  context.addCommonOptions(*command, {.threads = false});
  command->footer(
      "The first file decides the pixels; the others add the channels that it lacks.\n"
      "Examples:\n"
      "  surfeit composite passes.exr light.exr -o lit.png --channel lit --exposure 1\n"
      "  surfeit composite passes.exr light.exr -o small.png --channel occlusion \\\n"
      "      --range \"0 0.8\" --reduce 2 --background \"1 1 1\"");
  command->callback(
      [arguments, &context] { context.run([&] { return runComposite(*arguments, context); }); });
}

}  // namespace surfeit
