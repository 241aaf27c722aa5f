// surfeit relight: other direct light, or one light more, at the surfels of a scene.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "surfeit/process.h"
#include "surfeit/relight.h"
#include "tools/command.h"
#include "tools/sample_options.h"

namespace surfeit {
namespace {

struct RelightArguments {
  std::string scene, result;
  RelightOptions options;
};

Status runRelight(RelightArguments& arguments, CommandContext& context) {
  RelightOptions& options = arguments.options;
  options.threads = context.threads();
  SURFEIT_ASSIGN_OR_RETURN(const RelightStats stats, relightScene(arguments.scene, arguments.result,
                                                                  options, context.progress()));
  const glm::dvec3& mean = stats.mean_radiosity;
  context.say(fmt::format(
      "{}: {} surfels, {} of them in the new light, {}, in {:.1f} s ({:.2f} M surfels/s); shadows "
      "of {} triangles; mean radiosity {:.4g} {:.4g} {:.4g}\nmemory: peak resident {}",
      arguments.result, formatCount(stats.surfels), formatCount(stats.lit_surfels),
      formatBytes(stats.file_bytes), context.wallSeconds(),
      double(stats.surfels) / std::max(stats.light_seconds, 1e-9) / 1e6,
      formatCount(stats.triangles), mean.r, mean.g, mean.b, formatBytes(peakResidentBytes())));
  return context.writeStats({{"command", "relight"},
                             {"surfels", stats.surfels},
                             {"lit_surfels", stats.lit_surfels},
                             {"triangles", stats.triangles},
                             {"file_bytes", stats.file_bytes},
                             {"gain", options.gain},
                             {"adds", options.adds},
                             {"mean_radiosity", {mean.r, mean.g, mean.b}},
                             {"phases",
                              {{"load", stats.load_seconds},
                               {"build", stats.build_seconds},
                               {"light", stats.light_seconds}}}});
}

void addLayerOptions(CLI::App& command, RelightOptions& options) {
  constexpr const char* kGroup = "Light";
  command
      .add_flag("--add", options.adds,
                "Add to the light of the scene, instead of taking its place: lights in layers")
      ->group(kGroup);
  command.add_option("--gain", options.gain, "Factor of the new light")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str()
      ->group(kGroup);
}

void addShadowOptions(CLI::App& command, RelightOptions& options) {
  constexpr const char* kGroup = "Shadows";
  command
      .add_option("--mesh", options.meshes,
                  "Triangle meshes that cast shadows: PLY, or OBJ with MTL; those with emission "
                  "give light, too (default: no shadows)")
      ->type_name("MESH")
      ->group(kGroup);
  command
      .add_flag("!--no-mesh-light", options.meshes_emit,
                "Emissive triangles of the meshes give no light: for layers on light that has it")
      ->group(kGroup);
  command
      .add_option("--shadow-bias", options.shadow_bias,
                  "Distance above a surfel at which its shadow rays start, at least; more where "
                  "surfels do not lie on the meshes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->group(kGroup);
}

}  // namespace

void addRelightCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "relight", "Give the surfels of a scene other direct light, without sampling again");
  const auto arguments = std::make_shared<RelightArguments>();
  RelightOptions& options = arguments->options;
  command->add_option("SCENE", arguments->scene, "Scene file (.sft) with albedo")->required();
  command->add_option("-o,--output", arguments->result, "Scene file to write (.sft)")->required();
  addLampOptions(*command, options.lights);
  addLayerOptions(*command, options);
  addShadowOptions(*command, options);
  addGroundOptions(*command, options.ground);
  command
      ->add_option_function<std::string>(
          "--up",
          [&options](const std::string& axis) { options.ground.up = UpAxis(axis[0] - 'x'); },
          "Axis that points up from the ground: x, y or z [y]")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->type_name("AXIS")
      ->group("Ground");
  context.addCommonOptions(*command);
  command->footer(
      "The result holds the same surfels, pages and nodes with new radiosities: albedo times the\n"
      "irradiance of the lights. Meshes are held in memory, some 100 bytes per triangle.\n"
      "Examples:\n"
      "  surfeit relight cornell.sft -o noon.sft --mesh cornell.obj \\\n"
      "      --light-directional \"-1 -2 -1  3 3 3\"\n"
      "  surfeit relight noon.sft -o lamp.sft --mesh cornell.obj --no-mesh-light --add --gain 0.5 "
      "\\\n"
      "      --light-point \"0.5 0.9 0.5  2 2 1\"");
  command->callback(
      [arguments, &context] { context.run([&] { return runRelight(*arguments, context); }); });
}

}  // namespace surfeit
