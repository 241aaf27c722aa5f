// A page at a time: decode its surfels, light them, hand the radiosity to the rewriter, which asks
// for pages from many threads.
#include "surfeit/relight.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "cloud/cloud_formats.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/resident_limit.h"
#include "core/seconds_since.h"
#include "core/surfel_limits.h"
#include "core/thread_check.h"
#include "core/thread_scratch.h"
#include "octree/node/stored_loss.h"
#include "octree/read/scene_file.h"
#include "octree/relight/radiosity_rewriter.h"
#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "sample/surroundings.h"
#include "storage/output_target.h"
#include "storage/page_file.h"

namespace surfeit {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMostGain = 1e6;
// What a provenance holds layers of light under, and bounces.
constexpr const char* kLayersKey = "relight";
constexpr const char* kBouncesKey = "bounce";

// Scratch of a thread.
struct LightScratch {
  SceneFile::Scratch read;
  std::vector<Surfel> surfels;
};

// The new radiosity of the surfels. Safe from any thread.
class RelitRadiosity : public RadiositySource {
 public:
  // All must outlive it. Positions in the scene are `shift` away from those that `light` has.
  RelitRadiosity(const SceneFile& scene, const DirectLight& light, const glm::dvec3& shift,
                 const RelightOptions& options)
      : scene_(scene), light_(light), shift_(shift), options_(options) {}

  using RadiositySource::read;
  Status read(std::uint32_t surfel_page, std::span<glm::vec3> radiosity) override {
    const std::uint32_t capacity = scene_.header().surfel_group_capacity;
    LightScratch& scratch = threadScratch<LightScratch>([] {});
    scratch.surfels.resize(capacity);
    SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                             scene_.decodeSurfels(surfel_page, scratch.read, scratch.surfels));
    if (count != radiosity.size()) {
      return Status::failed(
          fmt::format("{}: surfel page {}: {} surfels, expected {}: the file "
                      "changed meanwhile",
                      scene_.path(), surfel_page, count, radiosity.size()));
    }
    std::uint64_t lit = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Surfel& surfel = scratch.surfels[i];
      const glm::vec3 added = newLight(surfel, std::uint64_t{surfel_page} * capacity + i);
      if (added != glm::vec3(0)) ++lit;
      radiosity[i] = glm::min(options_.adds ? surfel.radiosity + added : added, kLargestColor);
    }
    lit_surfels_ += lit;
    return {};
  }

  std::uint64_t litSurfels() const { return lit_surfels_; }

 private:
  glm::vec3 newLight(const Surfel& surfel, std::uint64_t seed) const {
    SurfacePoint point;
    point.position = glm::vec3(glm::dvec3(surfel.position) + shift_);
    point.normal = point.geometric_normal = surfel.normal;
    point.lift = lift(surfel);
    glm::vec3 irradiance = light_.irradiance(point, seed, light_.samples());
    if (surfel.isTwoSided() && !surfel.isSphere()) {
      point.normal = point.geometric_normal = -surfel.normal;
      irradiance = 0.5f * (irradiance + light_.irradiance(point, seed, light_.samples()));
    }
    return float(options_.gain) * surfel.albedo * irradiance;
  }

  // Quantization may have put the surfel below the surface that it stands for.
  float lift(const Surfel& surfel) const {
    const double loss = scene_.header().full_precision ? 0 : positionLoss(surfel);
    return float(std::max(loss, options_.shadow_bias));
  }

  const SceneFile& scene_;
  const DirectLight& light_;
  const glm::dvec3 shift_;
  const RelightOptions& options_;
  std::atomic<std::uint64_t> lit_surfels_{0};
};

Status checkRelightOptions(const RelightOptions& options) {
  const auto refuse = [](const char* what, double found, const char* expected) {
    return Status::invalidArgument(fmt::format("{} {}: expected {}", what, found, expected));
  };
  if (!(options.gain >= 0) || !(options.gain <= kMostGain)) {
    return refuse("gain", options.gain, "0 to 1e6");
  }
  if (!(options.shadow_bias >= 0) || !std::isfinite(options.shadow_bias)) {
    return refuse("shadow bias", options.shadow_bias, "a length of 0 or more");
  }
  if (options.lights.with_emission) {
    return Status::invalidArgument(
        "emission of surfels: a scene does not keep it apart: sample the meshes with --emission, "
        "or add light to a scene that has it (--add)");
  }
  if (options.ground.enabled && options.meshes.empty()) {
    return Status::invalidArgument("ground plane: lies below meshes, found none: give --mesh");
  }
  return checkSurroundings({.ground = options.ground, .lights = options.lights});
}

class Relighter {
 public:
  Relighter(const std::string& scene_path, const std::string& result_path,
            const RelightOptions& options, Progress& progress)
      : scene_path_(scene_path),
        result_path_(result_path),
        options_(options),
        progress_(progress) {}

  Result<RelightStats> run();

 private:
  Status openScene();
  Status loadShadows();
  Status checkMemory() const;
  Status write(RelitRadiosity& radiosity);
  std::uint64_t meshContent() const;
  std::uint64_t lightContent() const;
  Result<std::string> provenance() const;

  const std::string& scene_path_;
  const std::string& result_path_;
  const RelightOptions& options_;
  Progress& progress_;
  SceneFile scene_;
  Mesh mesh_;                     // without triangles where nothing casts shadows
  std::optional<RayScene> rays_;  // absent then
  RelightStats stats_;
};

Result<RelightStats> Relighter::run() {
  stats_.threads = options_.threads > 0 ? options_.threads : defaultThreadCount();
  requireThreads(stats_.threads);
  SURFEIT_RETURN_IF_ERROR(openScene());
  SURFEIT_RETURN_IF_ERROR(loadShadows());
  SURFEIT_RETURN_IF_ERROR(checkMemory());
  const DirectLight light =
      rays_ ? DirectLight(mesh_, *rays_, options_.lights) : DirectLight(mesh_, options_.lights);
  if (!light.hasLight()) {
    return Status::invalidArgument(fmt::format(
        "{}: no light and nothing emits: give --light-point, --light-directional or --light-area, "
        "or meshes with emission (Ke)",
        scene_path_));
  }
  if (options_.adds && light.hasEmissiveMeshes()) {
    progress_.note(fmt::format(
        "{}: the emissive triangles of the meshes give light that is added, too: leave it out "
        "(--no-mesh-light) where {} has it already",
        result_path_, scene_path_));
  }
  RelitRadiosity radiosity(scene_, light, scene_.header().origin - mesh_.origin, options_);
  SURFEIT_RETURN_IF_ERROR(write(radiosity));
  stats_.lit_surfels = radiosity.litSurfels();
  if (stats_.lit_surfels == 0) {
    progress_.note(fmt::format("warning: {}: no surfel gets any of the new light that it reflects",
                               result_path_));
  }
  return stats_;
}

Status Relighter::openScene() {
  SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path_, scene_path_, "scene"));
  noteSceneName(result_path_, progress_);
  SURFEIT_ASSIGN_OR_RETURN(scene_, SceneFile::open(scene_path_));
  stats_.surfels = scene_.header().surfel_count;
  if (!scene_.header().channels.albedo) {
    return Status::corruption(
        fmt::format("{}: found no albedo, expected one for every surfel, to reflect light by: "
                    "index clouds with albedo_r albedo_g albedo_b, as surfeit sample writes them",
                    scene_path_));
  }
  if (scene_.header().has_lobes) {
    progress_.note(fmt::format(
        "{}: the lobes of the glossy bounces of {} are left out: what was sent in them is sent "
        "evenly",
        result_path_, scene_path_));
  }
  return {};
}

// Behind the meshes, so that what it names has room for both.
Status Relighter::checkMemory() const {
  return checkResidentBytes(
      fmt::format("{}: pages of {} threads", scene_path_, stats_.threads),
      rewriteRadiosityBytes(scene_, stats_.threads) + scene_.pages().memoryBytes());
}

Status Relighter::loadShadows() {
  if (options_.meshes.empty()) {
    mesh_.origin = scene_.header().origin;
    progress_.note(fmt::format(
        "{}: no mesh: the new light casts no shadows; --mesh gives what casts them", result_path_));
    return {};
  }
  Clock::time_point begin = Clock::now();
  progress_.beginPhase("load", 0, "triangles");
  const Surroundings surroundings = {.ground = options_.ground, .lights = options_.lights};
  SURFEIT_ASSIGN_OR_RETURN(mesh_, loadScene(options_.meshes, surroundings, progress_));
  if (!options_.meshes_emit) {
    for (Material& material : mesh_.materials) material.emission = glm::vec3(0);
  }
  stats_.triangles = mesh_.triangle.size();
  stats_.load_seconds = secondsSince(begin);

  begin = Clock::now();
  progress_.beginPhase("build", 0, "triangles");
  SURFEIT_ASSIGN_OR_RETURN(rays_, RayScene::build(mesh_, stats_.threads));
  stats_.build_seconds = secondsSince(begin);
  return {};
}

Status Relighter::write(RelitRadiosity& radiosity) {
  const Clock::time_point begin = Clock::now();
  progress_.beginPhase("light", stats_.surfels, "surfels");
  SURFEIT_ASSIGN_OR_RETURN(const std::string text, provenance());
  const std::uint64_t parts[] = {scene_.pages().identity(), scene_.pages().directoryChecksum(),
                                 meshContent(), lightContent(),
                                 XXH3_64bits(text.data(), text.size())};
  SURFEIT_ASSIGN_OR_RETURN(PageFileWriter writer,
                           PageFileWriter::create(result_path_, XXH3_64bits(parts, sizeof parts),
                                                  rewrittenVersion(scene_)));
  Result<glm::dvec3> mean = Status::failed("relight: not written");
  withThreads(stats_.threads, [&] {
    mean = rewriteRadiosity(scene_, radiosity, writer, stats_.threads, progress_);
  });
  SURFEIT_RETURN_IF_ERROR(mean.status());
  SURFEIT_RETURN_IF_ERROR(writer.finish(rewrittenSceneFields(scene_), text));
  stats_.mean_radiosity = *mean;
  stats_.file_bytes = writer.fileBytes();
  stats_.light_seconds = secondsSince(begin);
  return {};
}

// Differs between meshes that cast other shadows.
std::uint64_t Relighter::meshContent() const {
  const auto hash = [](const auto& values, std::uint64_t seed) {
    return XXH3_64bits_withSeed(values.data(), values.size() * sizeof values[0], seed);
  };
  std::uint64_t content = XXH3_64bits(&mesh_.origin, sizeof mesh_.origin);
  content = hash(mesh_.position, content);
  content = hash(mesh_.uv, content);
  content = hash(mesh_.triangle, content);
  content = hash(mesh_.triangle_material, content);
  for (const Material& material : mesh_.materials) {
    const float values[] = {material.emission.r, material.emission.g, material.emission.b,
                            material.opacity.r};
    content = XXH3_64bits_withSeed(values, sizeof values, content ^ material.mask);
    if (material.opacity != glm::vec3(material.opacity.r)) {
      content = XXH3_64bits_withSeed(&material.opacity, sizeof material.opacity, content);
    }
    if (material.glow != kNoTexture) content = mesh_.textures[material.glow].content(content);
  }
  for (const Mask& mask : mesh_.masks) content = mask.content(content);
  return content;
}

std::uint64_t Relighter::lightContent() const {
  const Lights& lights = options_.lights;
  std::vector<double> values;
  const auto add = [&values](const glm::dvec3& value) {
    values.insert(values.end(), {value.x, value.y, value.z});
  };
  for (const PointLight& light : lights.points) add(light.position), add(light.intensity);
  for (const DirectionalLight& light : lights.directionals) {
    add(light.direction), add(light.irradiance);
  }
  for (const AreaLight& light : lights.areas) {
    add(light.centre), add(light.u), add(light.v), add(light.radiance);
  }
  values.push_back(options_.shadow_bias);
  if (lights.falloff != 2) {
    values.insert(values.end(), {double(lights.falloff), lights.falloff_distance});
  }
  return XXH3_64bits(values.data(), values.size() * sizeof(double));
}

// What the scene's says, and this layer. Bounces of light that is gone go with it.
Result<std::string> Relighter::provenance() const {
  nlohmann::json json = nlohmann::json::parse(scene_.provenance(), nullptr, false);
  if (!json.is_object()) json = nlohmann::json::object();
  if (!options_.adds) {
    json.erase(kLayersKey);
    if (json.erase(kBouncesKey) > 0) {
      progress_.note(fmt::format(
          "{}: the bounces of {} go with its light: bounce the result, or keep them with --add",
          result_path_, scene_path_));
    }
  }
  const Lights& lights = options_.lights;
  nlohmann::json& layers = json[kLayersKey];
  if (!layers.is_array()) layers = nlohmann::json::array();
  layers.push_back({{"points", lights.points.size()},
                    {"directionals", lights.directionals.size()},
                    {"areas", lights.areas.size()},
                    {"samples", lights.samples},
                    {"gain", options_.gain},
                    {"adds", options_.adds},
                    {"triangles", stats_.triangles}});
  if (lights.falloff != 2) {
    layers.back()["falloff"] = lights.falloff;
    layers.back()["falloff_distance"] = lights.falloff_distance;
  }
  std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() <= kMaxProvenanceBytes) return text;
  return Status::invalidArgument(
      fmt::format("{}: {} layers of light: their description takes {} bytes, expected at most {}: "
                  "give several lights in one layer",
                  result_path_, layers.size(), text.size(), kMaxProvenanceBytes));
}

}  // namespace

Result<RelightStats> relightScene(const std::string& scene_path, const std::string& result_path,
                                  const RelightOptions& options, Progress& progress) {
  return guarded(result_path, [&]() -> Result<RelightStats> {
    SURFEIT_RETURN_IF_ERROR(checkRelightOptions(options));
    return Relighter(scene_path, result_path, options, progress).run();
  });
}

}  // namespace surfeit
