#include "tools/view_options.h"

#include <fmt/format.h>

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/camera_options.h"
#include "tools/number_checks.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

constexpr const char* kCameraGroup = "Camera";
constexpr const char* kPictureGroup = "Picture";
constexpr const char* kSurfelGroup = "Surfels";

glm::dvec3 parseVector(const std::string& option, const std::string& text) {
  const std::array<double, 3> v = parseNumberList<3>(option, text, "three numbers, \"x y z\"");
  return {v[0], v[1], v[2]};
}

void addVector(CLI::App& app, const std::string& name, std::optional<glm::dvec3>& value,
               const std::string& help) {
  app.add_option_function<std::string>(
         name, [&value, name](const std::string& text) { value = parseVector(name, text); }, help)
      ->type_name("\"X Y Z\"")
      ->group(kCameraGroup);
}

// An option whose value is one of a few words.
template <typename Enum>
CLI::Option* addChoice(CLI::App& app, const std::string& name, Enum& value,
                       const std::vector<std::pair<std::string, Enum>>& choices,
                       const std::string& help) {
  return app.add_option_function<std::string>(
      name,
      [&value, name, choices](const std::string& text) {
        std::string words;
        for (const auto& [word, choice] : choices) {
          if (word == text) {
            value = choice;
            return;
          }
          words += (words.empty() ? "" : ", ") + word;
        }
        throw CLI::ValidationError(name,
                                   fmt::format("found \"{}\", expected one of {}", text, words));
      },
      help);
}

void addRange(CLI::App& app, std::optional<glm::dvec2>& range, const char* group) {
  app.add_option_function<std::string>(
         "--range",
         [&range](const std::string& text) {
           const auto ends = parseNumberList<2>("--range", text, "two numbers, \"black white\"");
           range = glm::dvec2(ends[0], ends[1]);
         },
         "Value shown black and value shown white. Default: scalars other than occlusion are "
         "stretched over the values they take, in PNG")
      ->type_name("\"BLACK WHITE\"")
      ->group(group);
}

// How light becomes a PNG.
void addDisplayOptions(CLI::App& app, float& exposure, glm::vec3& background) {
  app.add_option("--exposure", exposure,
                 "Stops of exposure: PNG light is multiplied by 2^EV (default 0)")
      ->type_name("EV")
      ->group(kPictureGroup);
  app.add_option_function<std::string>(
         "--background",
         [&background](const std::string& text) {
           background = glm::vec3(parseVector("--background", text));
         },
         "Color behind the cloud in PNG, display values 0..1 (default \"0.13 0.13 0.13\"); EXR "
         "has alpha instead")
      ->type_name("\"R G B\"")
      ->group(kPictureGroup);
}

void addCameraOptions(CLI::App& app, CameraOptions& camera, std::optional<UpAxis>& up) {
  addVector(app, "--eye", camera.eye,
            "Position of the eye. Default: a three-quarter view that frames the cloud; outliers "
            "beyond three standard deviations may be cut off");
  addVector(app, "--look-at", camera.look_at,
            "Point that the eye looks at. Default: the centre of the cloud's bounds");
  app.add_option_function<std::string>(
         "--up,--up-axis",
         [&camera, &up](const std::string& text) {
           const bool is_axis = text == "x" || text == "y" || text == "z";
           if (is_axis) up = UpAxis(text[0] - 'x');
           if (!is_axis) camera.up = parseVector("--up", text);
         },
         "Axis that is up, x, y or z, or a direction. Default: as the cloud states, else y")
      ->type_name("AXIS|\"X Y Z\"")
      ->group(kCameraGroup);
  app.add_option("--fov", camera.fov_degrees, "Vertical field of view in degrees (default 35)")
      ->type_name("DEGREES")
      ->group(kCameraGroup);
}

void addSurfelOptions(CLI::App& app, ViewOptions& options) {
  addChoice<ViewMode>(
      app, "--mode", options.mode,
      {{"discs", ViewMode::kDiscs}, {"points", ViewMode::kPoints}, {"normals", ViewMode::kNormals}},
      "discs: each surfel as its disk, or as a sphere without a normal (default); "
      "points: as a square; normals: disks colored by 0.5 n + 0.5")
      ->type_name("MODE")
      ->group(kSurfelGroup);
  app.add_option("--channel", options.channel,
                 "Channel to show: any property or triple (radiosity, irradiance, albedo, color, "
                 "environment, reflection, fluence, bent_normal, normal, position, ...), or lit = "
                 "radiosity + albedo * (irradiance + environment), indirect = albedo * "
                 "(irradiance + environment), ao = 1 - occlusion. Default: the first of lit, ao, "
                 "radiosity, color, albedo, normal, position that the cloud has. Values that are "
                 "not finite are magenta")
      ->type_name("NAME")
      ->group(kSurfelGroup);
  app.add_option(
         "--brick", options.brick,
         "Brick map (docs/brick.md) to look up channels in, at each surfel; its channels replace "
         "channels of the same name in the cloud")
      ->type_name("FILE")
      ->group(kSurfelGroup);
  app.add_option("--filter-width", options.filter_width,
                 "Width over which --brick averages, scene units; 0: the finest level there "
                 "(default: the diameter of the surfel)")
      ->type_name("W")
      ->check(kNonNegativeNumber.description(""))
      ->group(kSurfelGroup);
  addRange(app, options.range, kSurfelGroup);
  app.add_option("--radius", options.radius,
                 "Radius of every surfel, scene units. Default: the cloud's own, else from the "
                 "density of the cloud")
      ->type_name("R")
      ->check(kPositiveNumber.description(""))
      ->group(kSurfelGroup);
  app.add_option("--radius-scale", options.radius_scale, "Multiplies every radius (default 1)")
      ->type_name("FACTOR")
      ->check(kPositiveNumber.description(""))
      ->group(kSurfelGroup);
  app.add_option("--point-size", options.point_size,
                 "Edge of a square in pixels, with --mode points (default 1)")
      ->type_name("PIXELS")
      ->check(kPositiveNumber.description(""))
      ->group(kSurfelGroup);
  app.add_flag("--cull-back", options.cull_back, "Leave out disks that are seen from behind")
      ->group(kSurfelGroup);
}

void addPictureOptions(CLI::App& app, ViewOptions& options) {
  app.add_option_function<std::string>(
         "--size",
         [&options](const std::string& text) { parseSize(text, options.width, options.height); },
         "Pixels (default 1280x960)")
      ->type_name("WxH")
      ->group(kPictureGroup);
  app.add_option("--samples", options.samples,
                 "Samples along each edge of a pixel, averaged (default 2)")
      ->type_name("N")
      ->check(CLI::Range(1, 8).description(""))
      ->group(kPictureGroup);
  addDisplayOptions(app, options.exposure, options.background);
}

}  // namespace

void addViewOptions(CLI::App& app, ViewOptions& options) {
  addCameraOptions(app, options.camera, options.up);
  addSurfelOptions(app, options);
  addPictureOptions(app, options);
}

void addCompositeOptions(CLI::App& app, CompositeOptions& options) {
  app.add_option("--channel", options.channel,
                 "Channel to show: radiosity (direct light), indirect = albedo * (irradiance + "
                 "environment), lit = radiosity + indirect, ao = 1 - occlusion, or any other "
                 "channel of the files. Default: the first of lit, ao, radiosity, color, albedo, "
                 "normal, position that they have. Values that are not finite are magenta")
      ->type_name("NAME")
      ->group(kPictureGroup);
  app.add_option("--reduce", options.reduce,
                 "Pixels along each edge of the files that become one, their mean (default 1)")
      ->type_name("N")
      ->check(CLI::Range(1, 16).description(""))
      ->group(kPictureGroup);
  addRange(app, options.range, kPictureGroup);
  addDisplayOptions(app, options.exposure, options.background);
}

}  // namespace surfeit
