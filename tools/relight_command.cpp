// surfeit relight: other direct light, or one light more, at the surfels of a scene.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "surfeit/process.h"
#include "surfeit/relight.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/number_checks.h"
#include "tools/sample_options.h"

namespace surfeit {
namespace {

struct RelightArguments {
  std::string scene, result, gain = "1";
  LightNames names;
  RelightOptions options;
  bool is_dry_run = false;
};

constexpr double kMostGain = 1e6;

// Gains by name: "key=2,fill=.5".
Result<std::map<std::string, float>> parseGains(const std::string& text) {
  std::map<std::string, float> gains;
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::string_view part = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(part.size() + 1, rest.size()));
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string_view number = part.substr(std::min(equals + 1, part.size()));
    double gain = -1;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), gain);
    const bool is_number = error == std::errc() && end == number.data() + number.size();
    if (equals == 0 || !is_number || !(gain >= 0 && gain <= kMostGain)) {
      return Status::invalidArgument(
          fmt::format("--gain: found \"{}\" in \"{}\", expected a factor from 0 to {:g}, or "
                      "factors of lights by name, such as key=2,fill=.5",
                      part, text, kMostGain));
    }
    if (!gains.emplace(part.substr(0, equals), float(gain)).second) {
      return Status::invalidArgument(
          fmt::format("--gain: found \"{}\" twice in \"{}\"", part.substr(0, equals), text));
    }
  }
  return gains;
}

// Gives the lights of each name its gain.
Status applyGains(const std::map<std::string, float>& gains, const LightNames& names,
                  Lights& lights) {
  std::set<std::string> known;
  const auto gainOf = [&](const std::string& name) {
    if (!name.empty()) known.insert(name);
    const auto found = gains.find(name);
    return name.empty() || found == gains.end() ? 1.f : found->second;
  };
  const auto apply = [&](auto& of_kind, const std::vector<std::string>& of_names, auto light) {
    for (std::size_t i = 0; i < of_kind.size(); ++i) of_kind[i].*light *= gainOf(of_names[i]);
  };
  apply(lights.points, names.points, &PointLight::intensity);
  apply(lights.directionals, names.directionals, &DirectionalLight::irradiance);
  apply(lights.areas, names.areas, &AreaLight::radiance);
  for (const auto& [name, gain] : gains) {
    if (known.count(name) > 0) continue;
    return Status::invalidArgument(fmt::format(
        "--gain: no light has the name \"{}\": found {}; names stand before the numbers "
        "of a light, --light-point \"key=0 2 1  3 3 3\"",
        name, known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", "))));
  }
  return {};
}

// One factor of all light, or some of lights by name.
Status readGain(const RelightArguments& arguments, RelightOptions& options) {
  const std::string& text = arguments.gain;
  const char* const end = text.data() + text.size();
  double gain = 1;
  const auto [stop, error] = std::from_chars(text.data(), end, gain);
  if (error == std::errc() && stop == end && gain >= 0 && gain <= kMostGain) {
    options.gain = gain;
    return {};
  }
  SURFEIT_ASSIGN_OR_RETURN(const auto gains, parseGains(text));
  return applyGains(gains, arguments.names, options.lights);
}

Status runRelight(const RelightArguments& arguments, CommandContext& context) {
  RelightOptions options = arguments.options;
  SURFEIT_RETURN_IF_ERROR(readGain(arguments, options));
  options.threads = context.threads();
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastRelight(arguments.scene, arguments.result, options, context.progress()));
    return sayForecast("relight", "surfels", arguments.result, forecast, context);
  }
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

void addLayerOptions(CLI::App& command, RelightOptions& options, std::string& gain) {
  constexpr const char* kGroup = "Light";
  command
      .add_flag("--add", options.adds,
                "Add to the light of the scene, instead of taking its place: lights in layers")
      ->group(kGroup);
  command
      .add_option("--gain", gain,
                  "Factor of the new light, or of lights by the names before their numbers: "
                  "key=2,fill=.5")
      ->type_name("GAIN|NAME=GAIN,...")
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
      ->check(kNonNegativeNumber)
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
  addLampOptions(*command, options.lights, &arguments->names);
  addLayerOptions(*command, options, arguments->gain);
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
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command);
  context.addFrameOptions(*command);
  command->footer(
      "The result holds the same surfels, pages and nodes with new radiosities: albedo times the\n"
      "irradiance of the lights. Meshes are held in memory, some 100 bytes per triangle.\n"
      "Examples:\n"
      "  surfeit relight cornell.sft -o noon.sft --mesh cornell.obj \\\n"
      "      --light-directional \"-1 -2 -1  3 3 3\"\n"
      "  surfeit relight noon.sft -o lamp.sft --mesh cornell.obj --no-mesh-light --add --gain 0.5 "
      "\\\n"
      "      --light-point \"0.5 0.9 0.5  2 2 1\"\n"
      "  surfeit relight cornell.sft -o look.sft --light-point \"key=0 1 2  9 9 8\" \\\n"
      "      --light-directional \"fill=0 -1 -1  1 1 2\" --gain key=2,fill=.5");
  command->callback(
      [arguments, &context] { context.run([&] { return runRelight(*arguments, context); }); });
}

}  // namespace surfeit
