#include "bench/internal/embree_truth.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <limits>
#include <thread>

#include "bench/internal/embree_scene.h"
#include "core/square_strata.h"
#include "gather/rules/gather_outputs.h"
#include "storage/file.h"

namespace surfeit {
namespace {

constexpr int kLanes = 16;
// Changes with anything that changes the truth.
constexpr std::uint64_t kVersion = 1;

// A number for all that the truth depends on: receivers, geometry and rays.
std::uint64_t truthKey(const GatherScene& scene, const ReceiverSet& set,
                       const TruthOptions& options) {
  const SceneGeometry& geometry = scene.geometry();
  std::uint64_t key = mixBits(kVersion + std::uint64_t(options.rays) * 1000);
  const auto addBytes = [&key](const void* data, std::size_t size) {
    std::uint64_t word = 0;
    for (std::size_t i = 0; i < size; i += sizeof word) {
      std::memcpy(&word, static_cast<const std::byte*>(data) + i, std::min(sizeof word, size - i));
      key = mixBits(key * 0x9E3779B97F4A7C15u + word);
    }
  };
  const float settings[] = {geometry.ray_offset, geometry.color_wavelength,
                            geometry.is_two_sided ? 1.f : 0.f};
  addBytes(settings, sizeof settings);
  addBytes(geometry.mesh.position.data(), geometry.mesh.position.size() * sizeof(glm::vec3));
  addBytes(geometry.spheres.data(), geometry.spheres.size() * sizeof(TrueSphere));
  for (const std::uint32_t i : set.judged) addBytes(&set.receivers[i], sizeof(LocalReceiver));
  return key;
}

// Traces the rays of one receiver after the other. Safe from any thread.
class TruthTracer {
 public:
  TruthTracer(const SceneGeometry& geometry, const EmbreeScene& scene, int rays)
      : geometry_(geometry), scene_(scene), side_(int(std::lround(std::sqrt(double(rays))))) {}

  GatherResult trace(const LocalReceiver& receiver, std::uint64_t seed) const {
    const std::vector<glm::vec3> directions = stratifiedCosineDirections(side_, mixBits(seed));
    const TangentFrame frame(receiver.normal);
    const glm::vec3 origin = receiver.position + geometry_.ray_offset * receiver.normal;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    std::size_t hits = 0;
    glm::dvec3 radiosity(0);
    for (std::size_t first = 0; first < directions.size(); first += kLanes) {
      alignas(64) RTCRayHit16 rays;
      alignas(64) int valid[kLanes];
      for (int i = 0; i < kLanes; ++i) {
        const glm::vec3& local = directions[first + std::size_t(i)];
        const glm::vec3 direction =
            local.x * frame.x + local.y * frame.y + local.z * receiver.normal;
        valid[i] = -1;
        rays.ray.org_x[i] = origin.x, rays.ray.org_y[i] = origin.y, rays.ray.org_z[i] = origin.z;
        rays.ray.dir_x[i] = direction.x, rays.ray.dir_y[i] = direction.y;
        rays.ray.dir_z[i] = direction.z;
        rays.ray.tnear[i] = 0, rays.ray.tfar[i] = std::numeric_limits<float>::infinity();
        rays.ray.time[i] = 0, rays.ray.mask[i] = ~0u, rays.ray.id[i] = 0, rays.ray.flags[i] = 0;
        rays.hit.geomID[i] = rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect16(valid, scene_.handle(), &context, &rays);
      for (int i = 0; i < kLanes; ++i) {
        if (rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
        ++hits;
        const unsigned id = rays.hit.primID[i];
        const std::uint32_t material = rays.hit.geomID[i] == EmbreeScene::kSpheres
                                           ? geometry_.spheres[id].material
                                           : geometry_.mesh.triangle_material[id];
        const glm::vec3 direction(rays.ray.dir_x[i], rays.ray.dir_y[i], rays.ray.dir_z[i]);
        radiosity +=
            glm::dvec3(radiosityAt(geometry_, material, origin + rays.ray.tfar[i] * direction));
      }
    }
    const double weight = 1.0 / double(directions.size());
    return {float(double(hits) * weight), glm::vec3(radiosity * weight)};
  }

 private:
  const SceneGeometry& geometry_;
  const EmbreeScene& scene_;
  const int side_;
};

constexpr std::uint32_t kTruthOutputs = kOutputOcclusion | kOutputIrradiance;

// What earlier runs left; empty when there is none, or of something else.
std::vector<GatherResult> readTruth(const std::string& path, std::uint64_t key, std::size_t count) {
  std::vector<GatherResult> truth;
  const std::size_t floats = resultFloats(kTruthOutputs);
  std::vector<float> rows(count * floats);
  const Result<InputFile> file = InputFile::open(path);
  std::uint64_t found = 0;
  if (!file.ok() || file->size() != sizeof key + count * floats * sizeof(float)) return truth;
  if (!file->readAt(0, std::as_writable_bytes(std::span(&found, 1))).ok() || found != key) {
    return truth;
  }
  if (!file->readAt(sizeof key, std::as_writable_bytes(std::span(rows))).ok()) return truth;
  for (std::size_t i = 0; i < count; ++i) {
    truth.push_back(unpackResult(&rows[i * floats], kTruthOutputs));
  }
  return truth;
}

Status writeTruth(const std::string& path, std::uint64_t key,
                  const std::vector<GatherResult>& truth) {
  SURFEIT_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::create(path));
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(&key, 1))));
  const std::size_t floats = resultFloats(kTruthOutputs);
  std::vector<float> rows(truth.size() * floats);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    packResult(truth[i], kTruthOutputs, &rows[i * floats]);
  }
  SURFEIT_RETURN_IF_ERROR(file.append(std::as_bytes(std::span(rows))));
  return file.commit();
}

}  // namespace

Result<std::vector<GatherResult>> traceTruth(const GatherScene& scene, const ReceiverSet& set,
                                             const TruthOptions& options) {
  const std::uint64_t key = truthKey(scene, set, options);
  const std::string path = fmt::format("{}.{}.truth", scene.octreePath(), set.name);
  std::vector<GatherResult> truth = readTruth(path, key, set.judged.size());
  if (!truth.empty()) return truth;

  // Robust, so that no ray slips between two triangles
  SURFEIT_ASSIGN_OR_RETURN(
      const EmbreeScene embree,
      EmbreeScene::ofTruth(scene.geometry(), {.flags = RTC_SCENE_FLAG_ROBUST,
                                              .rejects_backs = !scene.geometry().is_two_sided,
                                              .threads = options.threads}));
  const TruthTracer tracer(scene.geometry(), embree, options.rays);
  truth.resize(set.judged.size());
  std::atomic<std::size_t> next = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < options.threads; ++thread) {
    threads.emplace_back([&] {
      for (std::size_t i = next++; i < truth.size(); i = next++) {
        truth[i] = tracer.trace(set.receivers[set.judged[i]], i);
      }
    });
  }
  threads.clear();
  if (scene.directory().isKept()) SURFEIT_RETURN_IF_ERROR(writeTruth(path, key, truth));
  return truth;
}

}  // namespace surfeit
