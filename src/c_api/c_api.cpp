// The C functions, as thin as they can be over surfeit/engine.h. Nothing is thrown out of them.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "c_api/c_guard.h"
#include "surfeit/engine.h"
#include "surfeit/surfeit.h"
#include "surfeit/version.h"

struct surfeit_engine {
  surfeit::Engine engine;
};
struct surfeit_scene {
  surfeit::Scene scene;
};
struct surfeit_gatherer {
  surfeit::Gatherer gatherer;
};

namespace surfeit {
namespace {

static_assert(sizeof(surfeit_result) == sizeof(GatherResult));
static_assert(int(SURFEIT_OUTPUT_RADIANCE_SH) == int(kOutputRadianceSh));
static_assert(SURFEIT_GLOSSY == int(GatherMode::kGlossy) &&
              SURFEIT_BACK == int(GatherSides::kBack));
static_assert(SURFEIT_FINAL == int(QualityPreset::kFinal));

Status readSettings(const surfeit_settings* given, GatherSettings& settings) {
  surfeit_settings from;
  surfeit_settings_init(&from);
  SURFEIT_RETURN_IF_ERROR(readOptions(given, "settings", from));
  SURFEIT_RETURN_IF_ERROR(readEnum(from.mode, GatherMode::kGlossy, "mode", settings.mode));
  SURFEIT_RETURN_IF_ERROR(
      readEnum(from.sides, GatherSides::kBack, "sides", settings.quality.sides));
  SURFEIT_RETURN_IF_ERROR(readEnum(from.distribution, GatherWeights::Distribution::kUniform,
                                   "distribution", settings.weights.distribution));
  SURFEIT_RETURN_IF_ERROR(readEnum(from.falloff_mode, GatherWeights::FalloffMode::kPolynomial,
                                   "falloff_mode", settings.weights.falloff_mode));
  settings.outputs = from.outputs;
  settings.groups = from.groups;
  settings.eye = {from.eye[0], from.eye[1], from.eye[2]};
  settings.quality.max_solid_angle = from.max_solid_angle;
  settings.quality.raster_resolution = from.raster_resolution;
  settings.quality.bias = from.bias;
  settings.quality.near_field_radii = from.near_field_radii;
  settings.quality.max_distance = from.max_distance;
  settings.quality.max_variation = from.max_variation;
  settings.weights.cone_angle = from.cone_angle;
  settings.weights.roughness = from.roughness;
  settings.weights.falloff = from.falloff;
  if (from.gains == nullptr && from.gain_count > 0) return missing("gains");
  for (const surfeit_group_gain& of : std::span(from.gains, from.gain_count)) {
    settings.gains.push_back({of.group, of.gain});
  }
  return {};
}

Status readEnvironment(const surfeit_environment* given,
                       std::optional<EnvironmentPixels>& environment,
                       std::vector<glm::vec3>& pixels) {
  if (given == nullptr) return {};
  surfeit_environment from;
  surfeit_environment_init(&from);
  SURFEIT_RETURN_IF_ERROR(readOptions(given, "environment", from));
  if (from.pixels == nullptr || from.width < 1 || from.height < 1) {
    return Status::invalidArgument("environment without pixels, expected some");
  }
  const std::size_t count = std::size_t(from.width) * std::size_t(from.height);
  pixels.resize(count);
  std::memcpy(pixels.data(), from.pixels, count * sizeof(glm::vec3));
  environment.emplace();
  environment->width = from.width;
  environment->height = from.height;
  environment->pixels = pixels.data();
  environment->rotation = from.rotation;
  environment->intensity = from.intensity;
  if (from.up_axis < 0) return {};
  UpAxis up = kDefaultUpAxis;
  SURFEIT_RETURN_IF_ERROR(readEnum(from.up_axis, UpAxis::kZ, "up_axis", up));
  environment->up = up;
  return {};
}

Status makeGatherer(surfeit_engine* engine, const std::vector<Instance>& instances,
                    const surfeit_settings* settings, const surfeit_environment* environment,
                    surfeit_gatherer** gatherer) {
  GatherSettings given;
  SURFEIT_RETURN_IF_ERROR(readSettings(settings, given));
  std::optional<EnvironmentPixels> light;
  std::vector<glm::vec3> pixels;
  SURFEIT_RETURN_IF_ERROR(readEnvironment(environment, light, pixels));
  SURFEIT_ASSIGN_OR_RETURN(Gatherer made,
                           engine->engine.gatherer(instances, given, light ? &*light : nullptr));
  *gatherer = new surfeit_gatherer{std::move(made)};
  return {};
}

// Asks a caller whether to stop.
class CancelProgress : public Progress {
 public:
  CancelProgress(surfeit_cancel cancel, void* user) : cancel_(cancel), user_(user) {}
  bool isCancelled() const override { return cancel_ != nullptr && cancel_(user_) != 0; }

 private:
  surfeit_cancel cancel_;
  void* user_;
};

surfeit_cache_statistics cacheStatistics(const GatherCacheStats& from) {
  surfeit_cache_statistics to = {};
  to.requests = from.requests;
  to.hits = from.hits;
  to.misses = from.misses;
  to.repeated_loads = from.repeated_loads;
  to.bytes_read = from.bytes_read;
  to.budget_bytes = from.budget_bytes;
  to.load_seconds = from.load_seconds;
  to.stall_seconds = from.stall_seconds;
  return to;
}

}  // namespace
}  // namespace surfeit

using namespace surfeit;  // NOLINT: what follows has C names

extern "C" {

const char* surfeit_last_error(void) { return lastErrorText(); }

const char* surfeit_version(void) { return kVersion; }

void surfeit_engine_options_init(surfeit_engine_options* options) {
  if (options == nullptr) return;
  *options = {};
  options->size = sizeof *options;
}

surfeit_code surfeit_engine_create(const surfeit_engine_options* options, surfeit_engine** engine) {
  return guard([&]() -> Status {
    if (engine == nullptr) return missing("engine");
    surfeit_engine_options from;
    surfeit_engine_options_init(&from);
    SURFEIT_RETURN_IF_ERROR(readOptions(options, "options", from));
    EngineOptions given;
    given.memory_bytes = from.memory_bytes;
    given.threads = from.threads;
    given.direct_io = from.direct_io != 0;
    given.lobes = from.lobes != 0;
    SURFEIT_ASSIGN_OR_RETURN(Engine made, Engine::create(given));
    *engine = new surfeit_engine{std::move(made)};
    return {};
  });
}

void surfeit_engine_release(surfeit_engine* engine) { delete engine; }

surfeit_code surfeit_engine_statistics(const surfeit_engine* engine,
                                       surfeit_statistics* statistics) {
  return guard([&]() -> Status {
    if (engine == nullptr) return missing("engine");
    const EngineStatistics from = engine->engine.statistics();
    surfeit_statistics report = {};
    report.receivers = from.receivers;
    report.memory_bytes = from.memory_bytes;
    report.held_bytes = from.held_bytes;
    report.scenes = from.scenes;
    report.gatherers = from.gatherers;
    report.node_cache = cacheStatistics(from.node_cache);
    report.surfel_cache = cacheStatistics(from.surfel_cache);
    return writeReport(report, "statistics", statistics);
  });
}

surfeit_code surfeit_scene_open(surfeit_engine* engine, const char* path, surfeit_scene** scene) {
  return guard([&]() -> Status {
    if (engine == nullptr) return missing("engine");
    if (path == nullptr) return missing("path");
    if (scene == nullptr) return missing("scene");
    SURFEIT_ASSIGN_OR_RETURN(Scene opened, engine->engine.open(path));
    *scene = new surfeit_scene{std::move(opened)};
    return {};
  });
}

surfeit_code surfeit_scene_open_bytes(surfeit_engine* engine, const void* bytes, size_t byte_count,
                                      const char* name, surfeit_scene** scene) {
  return guard([&]() -> Status {
    if (engine == nullptr) return missing("engine");
    if (bytes == nullptr) return missing("bytes");
    if (scene == nullptr) return missing("scene");
    SURFEIT_ASSIGN_OR_RETURN(
        Scene opened,
        engine->engine.openBytes(bytes, byte_count, name != nullptr ? name : "bytes"));
    *scene = new surfeit_scene{std::move(opened)};
    return {};
  });
}

void surfeit_scene_release(surfeit_scene* scene) { delete scene; }

surfeit_code surfeit_scene_get_info(const surfeit_scene* scene, surfeit_scene_info* info) {
  return guard([&]() -> Status {
    if (scene == nullptr) return missing("scene");
    const SceneInfo& from = scene->scene.info();
    surfeit_scene_info report = {};
    report.file_bytes = from.file_bytes;
    report.surfels = from.surfels;
    report.nodes = from.nodes;
    report.groups = from.groups;
    for (int axis = 0; axis < 3; ++axis) {
      report.min[axis] = from.min[axis];
      report.max[axis] = from.max[axis];
    }
    report.up_axis = std::int32_t(from.up);
    return writeReport(report, "info", info);
  });
}

void surfeit_settings_init(surfeit_settings* settings) {
  if (settings == nullptr) return;
  const GatherSettings defaults;
  *settings = {};
  settings->size = sizeof *settings;
  settings->mode = std::int32_t(defaults.mode);
  settings->outputs = defaults.outputs;
  settings->groups = defaults.groups;
  for (double& axis : settings->eye) axis = std::numeric_limits<double>::quiet_NaN();
  settings->max_solid_angle = defaults.quality.max_solid_angle;
  settings->raster_resolution = defaults.quality.raster_resolution;
  settings->bias = defaults.quality.bias;
  settings->near_field_radii = defaults.quality.near_field_radii;
  settings->max_distance = defaults.quality.max_distance;
  settings->sides = std::int32_t(defaults.quality.sides);
  settings->max_variation = defaults.quality.max_variation;
  settings->distribution = std::int32_t(defaults.weights.distribution);
  settings->cone_angle = defaults.weights.cone_angle;
  settings->roughness = defaults.weights.roughness;
  settings->falloff = defaults.weights.falloff;
  settings->falloff_mode = std::int32_t(defaults.weights.falloff_mode);
}

surfeit_code surfeit_settings_set_quality(surfeit_settings* settings, int32_t quality) {
  return guard([&]() -> Status {
    if (settings == nullptr) return missing("settings");
    QualityPreset preset = QualityPreset::kStandard;
    SURFEIT_RETURN_IF_ERROR(readEnum(quality, QualityPreset::kFinal, "quality", preset));
    GatherQuality values;
    setQuality(preset, values);
    settings->max_solid_angle = values.max_solid_angle;
    settings->raster_resolution = values.raster_resolution;
    settings->near_field_radii = values.near_field_radii;
    return {};
  });
}

void surfeit_environment_init(surfeit_environment* environment) {
  if (environment == nullptr) return;
  *environment = {};
  environment->size = sizeof *environment;
  environment->intensity = 1;
  environment->up_axis = -1;
}

surfeit_code surfeit_gatherer_create(surfeit_engine* engine, const surfeit_scene* scene,
                                     const surfeit_settings* settings,
                                     const surfeit_environment* environment,
                                     surfeit_gatherer** gatherer) {
  const surfeit_instance home = {scene, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
  return surfeit_gatherer_create_instances(engine, &home, 1, settings, environment, gatherer);
}

surfeit_code surfeit_gatherer_create_instances(surfeit_engine* engine,
                                               const surfeit_instance* instances,
                                               size_t instance_count,
                                               const surfeit_settings* settings,
                                               const surfeit_environment* environment,
                                               surfeit_gatherer** gatherer) {
  return guard([&]() -> Status {
    if (engine == nullptr) return missing("engine");
    if (instances == nullptr && instance_count > 0) return missing("instances");
    if (gatherer == nullptr) return missing("gatherer");
    std::vector<Instance> world;
    world.reserve(instance_count);
    for (std::size_t i = 0; i < instance_count; ++i) {
      if (instances[i].scene == nullptr) return missing("scene of an instance");
      Transform transform;
      std::copy_n(instances[i].m, transform.m.size(), transform.m.begin());
      world.push_back({instances[i].scene->scene, transform});
    }
    return makeGatherer(engine, world, settings, environment, gatherer);
  });
}

surfeit_code surfeit_gatherer_clone(const surfeit_gatherer* gatherer, surfeit_gatherer** clone) {
  return guard([&]() -> Status {
    if (gatherer == nullptr) return missing("gatherer");
    if (clone == nullptr) return missing("clone");
    SURFEIT_ASSIGN_OR_RETURN(Gatherer made, gatherer->gatherer.another());
    *clone = new surfeit_gatherer{std::move(made)};
    return {};
  });
}

void surfeit_gatherer_release(surfeit_gatherer* gatherer) { delete gatherer; }

surfeit_code surfeit_gather(surfeit_gatherer* gatherer, const surfeit_receiver* receivers,
                            size_t count, surfeit_result* results, surfeit_cancel cancel,
                            void* user) {
  return guard([&]() -> Status {
    if (gatherer == nullptr) return missing("gatherer");
    if (count == 0) return {};
    if (receivers == nullptr) return missing("receivers");
    if (results == nullptr) return missing("results");
    static_assert(sizeof(surfeit_receiver) == sizeof(Receiver));
    static_assert(offsetof(surfeit_receiver, normal) == offsetof(Receiver, normal));
    static_assert(offsetof(surfeit_receiver, view) == offsetof(Receiver, view));
    const CancelProgress progress(cancel, user);
    return gatherer->gatherer.gather(reinterpret_cast<const Receiver*>(receivers), count,
                                     reinterpret_cast<GatherResult*>(results), &progress);
  });
}

void surfeit_gatherer_pause(surfeit_gatherer* gatherer) {
  if (gatherer != nullptr) gatherer->gatherer.pause();
}

}  // extern "C"
