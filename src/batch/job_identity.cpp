#include "batch/job_identity.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "batch/bounce_look.h"
#include "gather/rules/sending_gains.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

using nlohmann::json;

std::string hashOf(Bytes bytes) {
  return fmt::format("{:016x}", XXH3_64bits(bytes.data(), bytes.size()));
}

json sceneIdentity(const SceneFile& scene) {
  const PageFile& pages = scene.pages();
  return {{"identity", fmt::format("{:016x}", pages.identity())},
          {"pages", fmt::format("{:016x}", pages.directoryChecksum())},
          {"fields", hashOf(pages.sceneFields())}};
}

// Settings that are at their defaults say nothing, so that jobs from before they were are the same.
void addNewerSettings(const GatherOptions& options, json& settings) {
  if (options.weights.by_brightness) settings["by_brightness"] = true;
  const int distance = options.quality.max_pixel_distance;
  if (distance != GatherQuality().max_pixel_distance) settings["max_pixel_distance"] = distance;
  if (!options.look.isOff()) settings["look"] = identityOf(options.look);
  if (!SendingGains(options.gains).isOff()) {
    for (const GroupGain& of : options.gains) settings["gains"][std::to_string(of.group)] = of.gain;
  }
}

json settingsOf(const GatherOptions& options) {
  const GatherQuality& quality = options.quality;
  const GatherWeights& weights = options.weights;
  return {{"mode", static_cast<int>(options.mode)},
          {"outputs", options.outputs},
          {"order", static_cast<int>(options.order)},
          {"max_solid_angle", quality.max_solid_angle},
          {"raster_resolution", quality.raster_resolution},
          {"bias", quality.bias},
          {"near_field_radii", quality.near_field_radii},
          {"max_distance", quality.max_distance},
          {"sides", static_cast<int>(quality.sides)},
          {"max_variation", quality.max_variation},
          {"distribution", static_cast<int>(weights.distribution)},
          {"cone_angle", weights.cone_angle},
          {"roughness", weights.roughness},
          {"falloff", weights.falloff},
          {"falloff_mode", static_cast<int>(weights.falloff_mode)},
          {"groups", options.groups},
          {"eye", {options.eye.x, options.eye.y, options.eye.z}}};
}

}  // namespace

json jobIdentity(const SceneFile& scene, const GatherJob& job) {
  const GatherOptions& options = job.options();
  json identity = {{"version", kVersion},
                   {"scene", sceneIdentity(scene)},
                   {"settings", settingsOf(options)},
                   {"receivers",
                    {{"rows", job.input().receiverCount()},
                     {"channels", options.channels},
                     {"part", options.part},
                     {"filter", options.filter},
                     {"color_range", static_cast<int>(options.color_range)}}}};
  addNewerSettings(options, identity["settings"]);
  if (const LoadedEnvironment* environment = job.environment()) {
    identity["environment"] = hashOf(std::as_bytes(environment->cube.pixels()));
  }
  // As it is read again: what is no number is null
  return json::parse(identity.dump());
}

Result<GatherOptions> optionsOfJob(const json& identity) {
  GatherOptions options;
  try {
    const json& settings = identity.at("settings");
    const json& receivers = identity.at("receivers");
    const int mode = settings.at("mode").get<int>();
    const int range = receivers.at("color_range").get<int>();
    options.outputs = settings.at("outputs").get<std::uint32_t>();
    if (mode < 0 || mode > int(GatherMode::kGlossy) || range < 0 || range > 255 ||
        options.outputs == 0 || (options.outputs & ~kAllOutputs) != 0) {
      return Status::corruption("options of a job that no gather has");
    }
    options.mode = static_cast<GatherMode>(mode);
    options.color_range = static_cast<ColorRange>(range);
    options.channels = receivers.at("channels").get<std::string>();
    options.part = receivers.at("part").get<std::string>();
    options.filter = receivers.at("filter").get<std::string>();
  } catch (const json::exception&) {
    return Status::corruption("no options of a job");
  }
  return options;
}

}  // namespace surfeit
