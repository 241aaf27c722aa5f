// surfeit cube: the raster cube of one receiver as a picture.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/cube.h"
#include "surfeit/cube_picture.h"
#include "surfeit/sample.h"
#include "surfeit/scene.h"
#include "surfeit/view.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/gather_options.h"
#include "tools/light_options.h"
#include "tools/number_list.h"
#include "tools/up_option.h"

namespace surfeit {
namespace {

constexpr const char* kReceiverGroup = "Receiver";
constexpr const char* kCubePictureGroup = "Picture";

struct CubeArguments {
  std::optional<UpAxis> up;  // absent: the scene's
  std::string scene, picture, receivers;
  std::uint64_t number = 0;
  Receiver receiver;
  GatherOptions options;
  CubePictureOptions drawing;
  std::vector<std::string> reference;
  int rays = 8;
};

glm::dvec3 parsePlace(const std::string& option, const std::string& text) {
  const std::array<double, 3> v = parseNumberList<3>(option, text, "three numbers X,Y,Z");
  return {v[0], v[1], v[2]};
}

// Words between commas.
std::vector<CubePanel> parsePanels(std::string_view text) {
  std::vector<CubePanel> panels;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(','));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    std::optional<CubePanel> found;
    std::string words;
    for (const CubePanel panel : kCubePanels) {
      if (panelName(panel) == word) found = panel;
      words += (words.empty() ? "" : ",") + std::string(panelName(panel));
    }
    if (!found) {
      throw CLI::ValidationError("--show",
                                 fmt::format("found \"{}\", expected some of {}", word, words));
    }
    panels.push_back(*found);
  }
  if (panels.empty()) throw CLI::ValidationError("--show", "found nothing, expected panels");
  return panels;
}

// Root mean square of the difference of coverage, by what directions count.
double coverageError(const CubeImage& cube, const CubeImage& traced) {
  double sum = 0, weight_sum = 0;
  for (std::size_t i = 0; i < cube.pixels.size(); ++i) {
    const CubePixel& pixel = cube.pixels[i];
    const double weight = double(pixel.weight) * double(pixel.solid_angle);
    const double difference = double(pixel.coverage) - double(traced.pixels[i].coverage);
    sum += weight * difference * difference;
    weight_sum += weight;
  }
  return weight_sum > 0 ? std::sqrt(sum / weight_sum) : 0;
}

std::string describe(const CubeImage& cube, const CubeArguments& arguments) {
  const glm::dvec3& at = cube.receiver.position;
  const glm::vec3 &n = cube.receiver.normal, &e = cube.irradiance;
  return fmt::format(
      "{}: receiver at {},{},{} with normal {:g},{:g},{:g}\n"
      "{} contributions, {} of them ray traced; occlusion {:.5f}, {} {:.5g} {:.5g} {:.5g}",
      arguments.picture, at.x, at.y, at.z, n.x, n.y, n.z, formatCount(cube.contributions),
      formatCount(cube.traced_surfels), cube.occlusion,
      arguments.options.mode == GatherMode::kGlossy ? "reflection" : "irradiance", e.x, e.y, e.z);
}

Status runCube(CubeArguments& arguments, CommandContext& context) {
  // Before any work: the name of the picture
  SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(arguments.picture));
  GatherOptions& options = arguments.options;
  options.memory_bytes = context.common.memory_bytes;
  options.outputs = kOutputOcclusion | kOutputIrradiance;
  if (!arguments.receivers.empty()) {
    SURFEIT_ASSIGN_OR_RETURN(
        arguments.receiver,
        readCubeReceiver(arguments.receivers, arguments.number, options.channels, options.part,
                         context.progress(), options.filter));
  }
  SURFEIT_ASSIGN_OR_RETURN(const CubeImage cube, gatherCube(arguments.scene, arguments.receiver,
                                                            options, context.progress()));
  std::optional<CubeImage> traced;
  if (!arguments.reference.empty()) {
    TracedCubeOptions tracing;
    tracing.rays = arguments.rays;
    tracing.sides = options.quality.sides;
    tracing.max_distance = options.quality.max_distance;
    tracing.threads = context.threads();
    SURFEIT_ASSIGN_OR_RETURN(traced,
                             traceCube(cube, arguments.reference, tracing, context.progress()));
  }
  const CubeViews cubes = {&cube, traced ? &*traced : nullptr};
  SURFEIT_ASSIGN_OR_RETURN(const SceneInfo info, readSceneInfo(arguments.scene));
  arguments.drawing.up = arguments.up.value_or(info.up);
  // The gather's memory is free again when the picture is drawn
  SURFEIT_RETURN_IF_ERROR(
      writeCubePicture(arguments.picture, cubes, arguments.drawing, options.memory_bytes));

  context.say(describe(cube, arguments));
  nlohmann::json fields = {
      {"command", "cube"},
      {"scene", arguments.scene},
      {"picture", arguments.picture},
      {"raster_resolution", cube.resolution},
      {"faces", cube.faces.size()},
      {"contributions", cube.contributions},
      {"traced_surfels", cube.traced_surfels},
      {"occlusion", cube.occlusion},
      {"irradiance", {cube.irradiance.x, cube.irradiance.y, cube.irradiance.z}}};
  if (traced) {
    const double error = coverageError(cube, *traced);
    context.say(fmt::format("rays: occlusion {:.5f}; coverage of pixels differs by {:.4f} RMS",
                            traced->occlusion, error));
    fields["reference_occlusion"] = traced->occlusion;
    fields["coverage_rms"] = error;
  }
  if (format == PictureFormat::kPng && !context.common.quiet) {
    context.answer(cubeLegend(cubes, arguments.drawing));
  }
  return context.writeStats(fields);
}

void addReceiverOptions(CLI::App& command, CubeArguments& arguments) {
  Receiver& receiver = arguments.receiver;
  CLI::Option* const at =
      command
          .add_option_function<std::string>(
              "--at",
              [&](const std::string& text) { receiver.position = parsePlace("--at", text); },
              "Position of the receiver")
          ->type_name("X,Y,Z")
          ->group(kReceiverGroup);
  command
      .add_option_function<std::string>(
          "--normal",
          [&](const std::string& text) {
            receiver.normal = glm::vec3(parsePlace("--normal", text));
          },
          "Normal of the receiver, of any length; without one it gathers over the whole sphere")
      ->type_name("X,Y,Z")
      ->needs(at)
      ->group(kReceiverGroup);
  CLI::Option* const receivers = command
                                     .add_option("--receivers", arguments.receivers,
                                                 "Cloud to take the receiver from, instead of --at")
                                     ->excludes(at)
                                     ->type_name("CLOUD")
                                     ->group(kReceiverGroup);
  command.add_option("--number", arguments.number, "Row of the receiver in the cloud, from 0")
      ->needs(receivers)
      ->type_name("N")
      ->default_str("0")
      ->group(kReceiverGroup);
  addChannelOptions(command, arguments.options.channels, arguments.options.part,
                    arguments.options.filter);
}

void addCubePictureOptions(CLI::App& command, CubeArguments& arguments) {
  CubePictureOptions& drawing = arguments.drawing;
  command
      .add_option_function<std::string>(
          "--show", [&](const std::string& text) { drawing.panels = parsePanels(text); },
          "Panels of a PNG, separated by commas")
      ->type_name("LIST")
      ->default_str("light,coverage,depth,layers,kind")
      ->group(kCubePictureGroup);
  command
      .add_option(
          "--zoom", drawing.zoom,
          "Edge of a pixel in a PNG (default: faces are about 128 wide, the face of a cone 384)")
      ->check(CLI::Range(1, 64).description(""))
      ->type_name("N")
      ->group(kCubePictureGroup);
  command
      .add_option("--exposure", drawing.exposure, "Stops of exposure: light times 2^EV in a PNG")
      ->type_name("EV")
      ->default_str("0")
      ->group(kCubePictureGroup);
  addUpOption(command, arguments.up, "Axis that is up in the picture", "the scene's")
      ->group(kCubePictureGroup);
  command
      .add_option("--reference", arguments.reference,
                  "Trace rays on this mesh (PLY or OBJ, as sample reads it; repeatable), and show "
                  "their coverage and depth beside the gather's; they carry no light")
      ->type_name("MESH")
      ->group(kCubePictureGroup);
  command.add_option("--rays", arguments.rays, "Rays along an edge of a pixel, with --reference")
      ->check(CLI::Range(1, 64))
      ->capture_default_str()
      ->group(kCubePictureGroup);
}

}  // namespace

void addCubeCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "cube", "Show the raster cube of one receiver, unfolded, and the source of each pixel");
  const auto arguments = std::make_shared<CubeArguments>();
  command->add_option("SCENE", arguments->scene, "Scene file (.sft)")->required();
  command
      ->add_option("-o,--output", arguments->picture,
                   "Picture: .png (panels) or .exr (values, one pixel per pixel of the raster)")
      ->required();
  addReceiverOptions(*command, *arguments);
  addModeOption(*command, arguments->options.mode);
  addQualityOptions(*command, arguments->options.quality);
  addDirectionOptions(*command, arguments->options);
  addSubsetOption(*command, arguments->options.groups, arguments->scene);
  addGainOption(*command, arguments->options.gains, arguments->scene);
  addCubePictureOptions(*command, *arguments);
  context.addCommonOptions(*command);
  command->footer(
      "The receiver is gathered alone, with light in every mode. A PNG has a panel for each of\n"
      "--show, and a legend on stdout; the middle face is the one that the normal points to.\n"
      "An EXR has the channels R G B coverage depth layers kind weight, and with --reference\n"
      "reference.coverage reference.depth; kind is 0 nothing, 1 flat node, 2 facet, 3 rough node,\n"
      "4 surfel as a patch, 5 ray-traced surfel; the occlusion is the sum of weight * coverage\n"
      "over the sum of weight.\n"
      "Examples:\n"
      "  surfeit cube cornell.sft --at 0.5,0,0.5 --normal 0,1,0 -o floor.png\n"
      "  surfeit cube cornell.sft --receivers receivers.ply --number 1234 -o cube.exr \\\n"
      "      --quality final\n"
      "  surfeit cube cornell.sft --at 0.5,0,0.5 --normal 0,1,0 -o compared.png \\\n"
      "      --reference cornell.obj --show coverage,depth,kind");
  command->callback([command, arguments, &context] {
    if (command->count("--at") + command->count("--receivers") == 0) {
      throw CLI::RequiredError("--at or --receivers");
    }
    context.run([&] { return runCube(*arguments, context); });
  });
}

}  // namespace surfeit
