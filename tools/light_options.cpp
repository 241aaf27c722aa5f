#include "tools/light_options.h"

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "tools/gather_options.h"
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
      ->check(CLI::NonNegativeNumber)
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
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->group(kGroup);
  addUpOption(command, environment.up, "Axis that points up", "the scene's")->group(kGroup);
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
  addDirectionOptions(command, options);
  addEnvironmentOptions(command, options.environment);
}

}  // namespace surfeit
