#include "gather/gather_options.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "core/job_limits.h"
#include "gather/gather_outputs.h"
#include "gather/gather_rules.h"
#include "gather/raster_cube.h"
#include "io/up_comment.h"

namespace surfeit {
namespace {

constexpr int kMostThreads = 4096;
constexpr float kNoDistance = 1e19f;

Status refuse(const char* what, auto found, const std::string& expected) {
  return Status::invalidArgument(fmt::format("{} is {}, expected {}", what, found, expected));
}

Status checkWeights(const GatherOptions& options) {
  const GatherWeights& weights = options.weights;
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
      !(options.quality.max_distance < kNoDistance)) {
    return Status::invalidArgument(
        "polynomial falloff needs a max distance, at which occlusion ends (--max-dist)");
  }
  return {};
}

Status checkOutputs(const GatherOptions& options) {
  if ((options.outputs & ~kAllOutputs) != 0) {
    return refuse("set of outputs", options.outputs, "GatherOutput values");
  }
  const bool has_environment = !options.environment.path.empty();
  if ((options.outputs & kOutputEnvironment) != 0 && !has_environment) {
    return Status::invalidArgument("output environment needs an environment (--environment)");
  }
  if (!(options.environment.intensity >= 0 && std::isfinite(options.environment.intensity))) {
    return refuse("intensity of the environment", options.environment.intensity, "0 or more");
  }
  if (!std::isfinite(options.environment.rotation)) {
    return refuse("rotation of the environment", options.environment.rotation, "radians");
  }
  return {};
}

}  // namespace

Status checkGatherOptions(const GatherOptions& options) {
  // No NaN passes any of these
  const auto isFromZero = [](float value) { return value >= 0 && std::isfinite(value); };
  const GatherQuality& quality = options.quality;
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
  SURFEIT_RETURN_IF_ERROR(checkWeights(options));
  SURFEIT_RETURN_IF_ERROR(checkOutputs(options));
  if (options.threads < 0 || options.threads > kMostThreads) {
    return refuse("thread count", options.threads, fmt::format("0 to {}", kMostThreads));
  }
  if (!(options.cache_split <= 1)) {
    return refuse("cache split", options.cache_split, "0 to 1, or a negative number to measure");
  }
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

Result<std::unique_ptr<const LoadedEnvironment>> loadEnvironment(const GatherOptions& options,
                                                                 UpAxis scene_up,
                                                                 Progress& progress) {
  GatherEnvironment environment = options.environment;
  if (environment.path.empty()) return std::unique_ptr<const LoadedEnvironment>();
  if (!environment.up) {
    environment.up = scene_up;
    progress.inform(fmt::format("{}: {} is up, as in the scene (--up)", environment.path,
                                upAxisName(scene_up)));
  }
  SURFEIT_ASSIGN_OR_RETURN(EnvironmentMap map, EnvironmentMap::load(environment, progress));
  EnvironmentCube cube(map, RasterGeometry(options.quality.raster_resolution));
  return std::make_unique<const LoadedEnvironment>(std::move(map), std::move(cube));
}

GatherOptions withDefaults(GatherOptions options) {
  if (options.outputs == 0) {
    options.outputs = usualOutputs(options.mode);
    if (!options.environment.path.empty()) options.outputs |= kOutputEnvironment;
  }
  if (options.threads == 0) options.threads = defaultThreadCount();
  if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes();
  return options;
}

}  // namespace surfeit
