#include "gather/rules/check_settings.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "gather/rules/gather_outputs.h"
#include "gather/rules/gather_rules.h"
#include "gather/rules/raster_geometry.h"

namespace surfeit {
namespace {

constexpr float kMostGain = 1e6f;

Status refuse(const char* what, auto found, const std::string& expected) {
  return Status::invalidArgument(fmt::format("{} is {}, expected {}", what, found, expected));
}

Status checkBrightness(const GatherSettings& settings, bool has_environment) {
  if (!has_environment) {
    return Status::invalidArgument(
        "occlusion by brightness needs an environment (--environment), which it weighs by");
  }
  if (!GatherRules(settings).has(kOutputOcclusion)) {
    return Status::invalidArgument(
        "occlusion by brightness: found no output occlusion, expected it among --outputs");
  }
  return {};
}

Status checkWeights(const GatherSettings& settings) {
  const GatherWeights& weights = settings.weights;
  if (!(weights.cone_angle >= 0 && weights.cone_angle <= kHemisphere + 1e-3f)) {
    return refuse("cone angle", weights.cone_angle, "0 to pi / 2 radians");
  }
  if (!(weights.roughness > 0 && weights.roughness <= 1)) {
    return refuse("roughness", weights.roughness, "over 0 to 1");
  }
  if (!(weights.falloff >= 0 && std::isfinite(weights.falloff))) {
    return refuse("falloff", weights.falloff, "0 or more");
  }
  if (weights.falloff > 0 && weights.falloff_mode == GatherWeights::FalloffMode::kPolynomial &&
      !(settings.quality.max_distance < kNoDistance)) {
    return Status::invalidArgument(
        "polynomial falloff needs a max distance, at which occlusion ends (--max-dist)");
  }
  return {};
}

Status checkGains(const GatherSettings& settings) {
  std::uint64_t seen = 0;
  for (const GroupGain& of_group : settings.gains) {
    if (of_group.group >= kMaxGroups) {
      return refuse("group of a gain", of_group.group, fmt::format("0 to {}", kMaxGroups - 1));
    }
    if (!(of_group.gain >= 0 && of_group.gain <= kMostGain)) {
      return refuse(fmt::format("gain of group {}", of_group.group).c_str(), of_group.gain,
                    fmt::format("0 to {:g}", kMostGain));
    }
    if ((seen & groupBit(of_group.group)) != 0) {
      return Status::invalidArgument(
          fmt::format("gain of group {}: found two, expected one", of_group.group));
    }
    seen |= groupBit(of_group.group);
  }
  if (settings.gains.empty() || GatherRules(settings).hasLight()) return {};
  return Status::invalidArgument(
      "gains of groups: found no output with the light of surfels, expected --mode bleeding or "
      "glossy, or --outputs irradiance");
}

}  // namespace

Status checkGatherSettings(const GatherSettings& settings, bool has_environment) {
  // No NaN passes any of these
  const auto isFromZero = [](float value) { return value >= 0 && std::isfinite(value); };
  const GatherQuality& quality = settings.quality;
  if (!isFromZero(quality.max_solid_angle)) {
    return refuse("max solid angle", quality.max_solid_angle, "0 or more steradians");
  }
  if (!RasterGeometry::isValidResolution(quality.raster_resolution)) {
    return refuse("raster resolution", quality.raster_resolution,
                  fmt::format("an even number from {} to {}", RasterGeometry::kMinResolution,
                              RasterGeometry::kMaxResolution));
  }
  if (!isFromZero(quality.bias)) return refuse("bias", quality.bias, "0 or more surfel radii");
  if (!isFromZero(quality.near_field_radii)) {
    return refuse("near field", quality.near_field_radii, "0 or more surfel radii");
  }
  if (!(quality.max_distance > 0)) {
    return refuse("max distance", quality.max_distance, "more than 0 scene units");
  }
  if (!isFromZero(quality.max_variation)) {
    return refuse("max variation", quality.max_variation, "0 or more");
  }
  constexpr int kLeast = 4;  // a packet
  if (quality.max_pixel_distance != 0 && quality.max_pixel_distance < kLeast) {
    return refuse("max pixel distance", quality.max_pixel_distance,
                  fmt::format("0, or {} and more", kLeast));
  }
  SURFEIT_RETURN_IF_ERROR(checkWeights(settings));
  SURFEIT_RETURN_IF_ERROR(checkGains(settings));
  if ((settings.outputs & ~kAllOutputs) != 0) {
    return refuse("set of outputs", settings.outputs, "GatherOutput values");
  }
  if ((settings.outputs & kOutputEnvironment) != 0 && !has_environment) {
    return Status::invalidArgument("output environment needs an environment (--environment)");
  }
  if (settings.weights.by_brightness) return checkBrightness(settings, has_environment);
  return {};
}

void setQuality(QualityPreset preset, GatherQuality& quality) {
  const GatherQuality standard;
  const auto set = [&](float max_solid_angle, int resolution, float near_field) {
    quality.max_solid_angle = max_solid_angle;
    quality.raster_resolution = resolution;
    quality.near_field_radii = near_field;
  };
  switch (preset) {
    case QualityPreset::kDraft:
      set(0.2f, 10, 4);
      break;
    case QualityPreset::kStandard:
      set(standard.max_solid_angle, standard.raster_resolution, standard.near_field_radii);
      break;
    case QualityPreset::kFinal:
      set(0.012f, 40, 16);
      break;
  }
}

}  // namespace surfeit
