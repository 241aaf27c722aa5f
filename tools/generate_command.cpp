// surfeit generate: scenes of any number of surfels, to try out what the other commands do at
// scale.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "surfeit/generate.h"
#include "tools/channel_options.h"
#include "tools/command.h"

namespace surfeit {
namespace {

struct GenerateArguments {
  std::string output;
  SceneRecipe recipe;
  bool is_recipe = false;  // write the recipe instead of the surfels
};

// An option whose text a function turns into a value, or into the Status that says why not.
template <typename Parse>
CLI::Option* addParsedOption(CLI::App& command, const std::string& name, const std::string& help,
                             Parse&& parse) {
  return command.add_option_function<std::string>(
      name,
      [name, parse](const std::string& text) {
        const Status status = parse(text);
        if (!status.ok()) throw CLI::ValidationError(name, status.message());
      },
      help);
}

Status runGenerate(const GenerateArguments& arguments, CommandContext& context) {
  const SceneRecipe& recipe = arguments.recipe;
  nlohmann::json fields = {{"command", "generate"},
                           {"kind", sceneKindName(recipe.kind)},
                           {"scene_surfels", recipe.surfels},
                           {"seed", recipe.seed},
                           {"order", recordOrderName(recipe.order)}};
  if (arguments.is_recipe) {
    SURFEIT_RETURN_IF_ERROR(writeSceneRecipe(recipe, arguments.output));
    context.say(
        fmt::format("{}: a recipe of {} surfels", arguments.output, formatCount(recipe.surfels)));
    return context.writeStats(std::move(fields));
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const GenerateStats stats,
      generateScene(recipe, arguments.output, context.threads(), context.progress()));
  const double seconds = std::max(context.wallSeconds(), 1e-9);
  context.say(fmt::format("{}: {} surfels in {:.1f} s ({:.2f} M surfels/s)", arguments.output,
                          formatCount(stats.surfels), seconds,
                          double(stats.surfels) / seconds / 1e6));
  fields["surfels"] = stats.surfels;
  fields["scene_area"] = stats.area;
  fields["surfels_per_second"] = double(stats.surfels) / seconds;
  return context.writeStats(std::move(fields));
}

void addSceneOptions(CLI::App& command, SceneRecipe& recipe) {
  addParsedOption(command, "--kind", "terrain, city or volume",
                  [&recipe](const std::string& text) -> Status {
                    SURFEIT_ASSIGN_OR_RETURN(recipe.kind, parseSceneKind(text));
                    return {};
                  })
      ->type_name("KIND")
      ->default_str(sceneKindName(recipe.kind));
  addParsedOption(command, "--surfels", "Surfels of the whole scene, such as 500k, 10M or 1G",
                  [&recipe](const std::string& text) -> Status {
                    SURFEIT_ASSIGN_OR_RETURN(recipe.surfels, parseSurfelCount(text));
                    return {};
                  })
      ->type_name("COUNT")
      ->default_str("10M");
  command
      .add_option("--seed", recipe.seed, "Seed: another seed gives another scene of the same kind")
      ->capture_default_str();
  addParsedOption(command, "--order",
                  "Order of the records: scan (neighbours follow each other), or shuffled",
                  [&recipe](const std::string& text) -> Status {
                    SURFEIT_ASSIGN_OR_RETURN(recipe.order, parseRecordOrder(text));
                    return {};
                  })
      ->type_name("ORDER")
      ->default_str(recordOrderName(recipe.order));
  addParsedOption(command, "--part", "Only the K-th of N equal runs of records",
                  [&recipe](const std::string& text) { return parseScenePart(text, recipe); })
      ->type_name("K/N");
  command.add_option("--outlier", recipe.outlier_distance,
                     "One more surfel, this many metres away (the last record)");
  command.add_option("--duplicates", recipe.duplicate_percent,
                     "Percentage of records that repeat an earlier one exactly");
}

}  // namespace

void addGenerateCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("generate", "Make a test scene of any number of surfels");
  const auto arguments = std::make_shared<GenerateArguments>();
  addCloudOutputOption(*command, arguments->output, "Cloud to write (or a recipe, of any name)");
  addSceneOptions(*command, arguments->recipe);
  command->add_flag(
      "--recipe", arguments->is_recipe,
      "Write a recipe instead of a cloud: a few lines that index accepts like a cloud");
  context.addCommonOptions(*command, {.threads = true, .stats = true});
  command->footer(
      "Scenes measure a kilometre by a kilometre; their surfaces do not depend on --surfels.\n"
      "Examples:\n"
      "  surfeit generate -o city.ply --surfels 10M\n"
      "  surfeit generate -o city.recipe --surfels 1G --recipe\n"
      "  surfeit generate -o part2.ply --surfels 100M --part 2/5 --order shuffled");
  command->callback(
      [arguments, &context] { context.run([&] { return runGenerate(*arguments, context); }); });
}

}  // namespace surfeit
