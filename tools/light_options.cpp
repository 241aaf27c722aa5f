#include "tools/light_options.h"

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "tools/camera_options.h"
#include "tools/gather_options.h"
#include "tools/look_options.h"
#include "tools/number_checks.h"
#include "tools/number_list.h"
#include "tools/up_option.h"

namespace surfeit {
void addDirectionOptions(CLI::App& command, GatherOptions& options) {
  constexpr const char* kGroup = "Directions";
  using Distribution = GatherWeights::Distribution;
  using FalloffMode = GatherWeights::FalloffMode;
  GatherWeights& weights = options.weights;
  command
      .add_option("--cone-angle,--coneangle", weights.cone_angle,
                  "Half the opening angle of the cone that counts, around the normal or the "
                  "reflection, in radians")
      ->check(CLI::Range(0.0, 1.571))
      ->default_str("pi / 2; glossy: by roughness")
      ->group(kGroup);
  addChoice<Distribution>(command, "--distribution", weights.distribution, "Weights of directions",
                          {{"cosine", Distribution::kCosine}, {"uniform", Distribution::kUniform}})
      ->group(kGroup);
  command
      .add_option("--falloff", weights.falloff,
                  "Occlusion fades with distance at this rate; 0: not at all")
      ->check(kNonNegativeNumber)
      ->capture_default_str()
      ->group(kGroup);
  addChoice<FalloffMode>(command, "--falloff-mode,--falloffmode", weights.falloff_mode,
                         "exp(-falloff * distance), or (1 - distance / max dist) ^ falloff",
                         {{"exponential", FalloffMode::kExponential},
                          {"polynomial", FalloffMode::kPolynomial},
                          {"0", FalloffMode::kExponential},
                          {"1", FalloffMode::kPolynomial}})
      ->group(kGroup);
  command
      .add_option(
          "--roughness", weights.roughness,
          "Width of the glossy lobe, above 0, up to 1; 1: all directions of the cone weigh alike")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option_function<std::string>(
          "--camera",
          [&options](const std::string& text) {
            const auto at = parseNumberList<3>("--camera", text, "a position X,Y,Z");
            options.eye = {at[0], at[1], at[2]};
          },
          "Viewpoint for glossy surfaces (default: view_x view_y view_z of the receivers)")
      ->type_name("X,Y,Z")
      ->group(kGroup);
  command
      .add_flag_callback(
          "--clamp", [] {},
          "Accepted for scripts of older tools; has no effect, pixels never count more than once")
      ->group(kGroup);
}

namespace {

void addEnvironmentOptions(CLI::App& command, GatherEnvironment& environment) {
  constexpr const char* kGroup = "Environment";
  command
      .add_option("--environment", environment.path,
                  "Picture of the surroundings: lat-long or cube OpenEXR, lat-long .hdr")
      ->group(kGroup);
  command
      .add_option_function<double>(
          "--environment-rotation",
          [&environment](double degrees) {
            environment.rotation = float(degrees * 0.017453292519943295);
          },
          "Turns the picture about the up axis, in degrees, counterclockwise seen from above")
      ->check(CLI::Range(-360.0, 360.0))
      ->default_str("0")
      ->group(kGroup);
  command.add_option("--environment-intensity", environment.intensity, "Factor of its light")
      ->check(kNonNegativeNumber)
      ->capture_default_str()
      ->group(kGroup);
  addUpOption(command, environment.up, "Axis that points up", "the scene's")->group(kGroup);
}

// Parsed behind --filter, which it adds to.
void addCropOption(CLI::App& command, std::string& filter) {
  command
      .add_option_function<std::string>(
          "--crop",
          [&filter](const std::string& text) {
            const PixelWindow crop = parseCrop(text);
            const std::string window =
                fmt::format("pixel_x >= {} and pixel_x < {} and pixel_y >= {} and pixel_y < {}",
                            crop.x0, crop.x1, crop.y0, crop.y1);
            filter = filter.empty() ? window : fmt::format("({}) and {}", filter, window);
          },
          "Only receivers of these pixels of passes: columns x0 to x1 - 1, rows y0 to y1 - 1 "
          "(pixel_x, pixel_y)")
      ->type_name("x0,y0,x1,y1");
}

}  // namespace

void addLightOptions(CLI::App& command, GatherOptions& options) {
  command
      .add_option_function<std::string>(
          "--outputs",
          [&options](const std::string& text) {
            const Result<std::uint32_t> outputs = parseOutputs(text);
            if (!outputs.ok()) throw CLI::ValidationError("--outputs", outputs.status().message());
            options.outputs = *outputs;
          },
          "Outputs at the receivers, separated by commas: " + describeOutputs(kAllOutputs))
      ->type_name("LIST")
      ->default_str("what the mode gives");
  command
      .add_option("--max-variation,--maxvariation", options.quality.max_variation,
                  "Interpolate between receivers, off by at most this at 99 % of them, such as "
                  "0.02; 0: gather at every receiver")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str()
      ->group("Quality");
  command
      .add_option("--max-pixel-dist,--maxpixeldist", options.quality.max_pixel_distance,
                  "With --max-variation, at most about so many pixels, or receivers, between "
                  "samples, 4 and more (0: no limit)")
      ->check(kNonNegativeNumber)
      ->capture_default_str()
      ->group("Quality");
  addDirectionOptions(command, options);
  addEnvironmentOptions(command, options.environment);
  command
      .add_flag("--occlusion-by-brightness", options.weights.by_brightness,
                "Occlusion is the covered part of the environment's light, instead of the covered "
                "part of the directions")
      ->group("Environment");
  addLookOptions(command, options.look);
  addCropOption(command, options.filter);
}

}  // namespace surfeit
