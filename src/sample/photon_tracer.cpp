// Photon maps: photons sent from the lights and scattered through the meshes, stored wherever they
// meet a diffuse surface (Jensen 1996; app note 6.1).

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <exception>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/photon_names.h"
#include "cloud/row_writer.h"
#include "cloud/surfel_names.h"
#include "core/job_limits.h"
#include "core/seconds_since.h"
#include "core/spherical_harmonics.h"
#include "core/split_mix.h"
#include "core/tangent_frame.h"
#include "core/thread_check.h"
#include "core/up_comment.h"
#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "sample/surroundings.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

// Photons that are sent at once; batches are cut by count, so that tasks do not depend on threads.
constexpr std::uint64_t kBatchPhotons = 1024;
constexpr std::size_t kBatchesInFlightPerThread = 4;
constexpr std::uint64_t kMostPhotons = std::uint64_t{1} << 40;
// Paths end also where nothing is absorbed: the powers of those that go on grow instead.
constexpr float kMostSurvival = 0.97f;

// A photon where it meets a surface: a row of the cloud, where the mesh's origin is 0.
struct Photon {
  glm::vec3 position;  // from the origin
  glm::vec3 normal;
  glm::vec3 power;
  glm::vec3 incident;  // direction in which it travels, unit length
  glm::vec3 albedo;
};
static_assert(sizeof(Photon) == 15 * sizeof(float));

// The row elsewhere.
struct FarPhoton {
  FarPhoton(const Photon& photon, const glm::dvec3& origin)
      : position(origin + glm::dvec3(photon.position)),
        rest{photon.normal, photon.power, photon.incident, photon.albedo} {}
  glm::dvec3 position;
  glm::vec3 rest[4];
};
static_assert(sizeof(FarPhoton) == 3 * sizeof(double) + 12 * sizeof(float));

std::vector<RowProperty> photonProperties(bool is_far) {
  std::vector<RowProperty> properties;
  for (const auto& names :
       {kPositionNames, kNormalNames, kPowerNames, kIncidentNames, kAlbedoNames}) {
    for (int i = 0; i < 3; ++i) {
      RowProperty property;
      property.name = names[i];
      properties.push_back(property);
    }
  }
  for (int i = 0; i < 3 && is_far; ++i) properties[std::size_t(i)].type = ValueType::kFloat64;
  return properties;
}

Status writeRows(std::span<const Photon> photons, const glm::dvec3& origin, RowWriter& writer) {
  if (origin == glm::dvec3(0)) return writer.writeRows(std::as_bytes(photons));
  std::vector<FarPhoton> far;
  far.reserve(photons.size());
  for (const Photon& photon : photons) far.emplace_back(photon, origin);
  return writer.writeRows(std::as_bytes(std::span(far)));
}

// Random numbers of one photon (SplitMix64).
class PhotonRandom {
 public:
  PhotonRandom(std::uint64_t seed, std::uint64_t photon)
      : state_(splitMix(splitMix(seed) + photon)) {}

  // In [0, 1).
  float next() {
    state_ += 0x9e3779b97f4a7c15u;
    return float(splitMix(state_) >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_;
};

// Uniform on the unit disk.
glm::vec2 diskPoint(PhotonRandom& random) {
  const float r = std::sqrt(random.next()), phi = 2 * kPi * random.next();
  return {r * std::cos(phi), r * std::sin(phi)};
}

// Around a unit normal, with density cos / pi: lifted from the disk.
glm::vec3 cosineDirection(const glm::vec3& normal, PhotonRandom& random) {
  const glm::vec2 p = diskPoint(random);
  const TangentFrame frame(normal);
  const float cos_theta = std::sqrt(std::max(0.0f, 1 - p.x * p.x - p.y * p.y));
  return glm::normalize(frame.tangent * p.x + frame.bitangent * p.y + normal * cos_theta);
}

glm::vec3 sphereDirection(PhotonRandom& random) {
  const float z = 1 - 2 * random.next(), phi = 2 * kPi * random.next();
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

float largest(const glm::vec3& rgb) { return std::max({rgb.x, rgb.y, rgb.z}); }
double luminance(const glm::dvec3& rgb) { return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z; }

struct Ray {
  glm::vec3 origin, direction;
};

// Everything that sends photons. Immutable; safe from any thread.
class Emitters {
 public:
  // Mesh and scene must outlive it.
  Emitters(const Mesh& mesh, const RayScene& scene, const Lights& lights)
      : mesh_(mesh), lights_(countedFrom(lights, mesh.origin)), offset_(scene.surfaceOffset()) {
    centre_ = scene.bounds().centre();
    reach_ = 0.5f * glm::length(scene.bounds().extent()) + offset_;
    for (std::size_t i = 0; i < lights.points.size(); ++i) {
      add(Kind::kPoint, i, 4 * double(kPi) * glm::dvec3(lights.points[i].intensity));
    }
    for (std::size_t i = 0; i < lights.directionals.size(); ++i) {
      const double disk = double(kPi) * double(reach_) * double(reach_);
      add(Kind::kDirectional, i, disk * glm::dvec3(lights.directionals[i].irradiance));
    }
    for (std::size_t i = 0; i < lights.areas.size(); ++i) {
      const AreaLight& light = lights.areas[i];
      const double area = 4 * double(glm::length(glm::cross(light.u, light.v)));
      add(Kind::kArea, i, double(kPi) * area * glm::dvec3(light.radiance));
    }
    for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
      const glm::dvec3 exitance(mesh.materials[mesh.triangle_material[i]].emission);
      add(Kind::kTriangle, i, triangleArea(mesh, std::uint32_t(i)) * exitance);
    }
  }

  bool isEmpty() const { return emitters_.empty(); }
  glm::dvec3 power() const { return power_; }

  // Photon number `index` of `count`: its ray, and its power. Emitters are chosen systematically by
  // luminance, so that each sends the share that it should but for less than one photon.
  Ray emit(std::uint64_t index, std::uint64_t count, PhotonRandom& random, glm::vec3& power) const {
    const double total = emitters_.back().luminance_sum;
    const double target = (double(index) + 0.5) / double(count) * total;
    const auto chosen = std::upper_bound(
        emitters_.begin(), emitters_.end() - 1, target,
        [](double value, const Emitter& emitter) { return value < emitter.luminance_sum; });
    const double probability = luminance(chosen->power) / total;
    power = glm::vec3(chosen->power / (probability * double(count)));
    return sendFrom(*chosen, random);
  }

 private:
  enum class Kind : std::uint8_t { kPoint, kDirectional, kArea, kTriangle };
  struct Emitter {
    Kind kind;
    std::size_t index;  // among those of its kind
    glm::dvec3 power;
    double luminance_sum;  // of this and those before
  };

  void add(Kind kind, std::size_t index, const glm::dvec3& power) {
    if (!(luminance(power) > 0)) return;
    const double before = emitters_.empty() ? 0 : emitters_.back().luminance_sum;
    emitters_.push_back({kind, index, power, before + luminance(power)});
    power_ += power;
  }

  Ray sendFrom(const Emitter& emitter, PhotonRandom& random) const {
    switch (emitter.kind) {
      case Kind::kPoint:
        return {glm::vec3(lights_.points[emitter.index].position), sphereDirection(random)};
      case Kind::kDirectional: {
        // From a disk before the scene that covers it
        const glm::vec3 direction = glm::normalize(lights_.directionals[emitter.index].direction);
        const TangentFrame frame(direction);
        const glm::vec2 p = reach_ * diskPoint(random);
        return {centre_ - 1.01f * reach_ * direction + p.x * frame.tangent + p.y * frame.bitangent,
                direction};
      }
      case Kind::kArea: {
        const AreaLight& light = lights_.areas[emitter.index];
        const float u = 2 * random.next() - 1, v = 2 * random.next() - 1;
        const glm::vec3 normal = glm::normalize(glm::cross(light.u, light.v));
        return {glm::vec3(light.centre) + u * light.u + v * light.v + offset_ * normal,
                cosineDirection(normal, random)};
      }
      case Kind::kTriangle:
        break;
    }
    // Uniform on the triangle: 1 - sqrt(u) weighs the first corner
    const float root = std::sqrt(random.next()), v = random.next();
    const SurfacePoint point =
        surfacePoint(mesh_, std::uint32_t(emitter.index), root * (1 - v), root * v);
    return {point.position + offset_ * point.geometric_normal,
            cosineDirection(point.geometric_normal, random)};
  }

  const Mesh& mesh_;
  const Lights lights_;
  float offset_;  // of rays from a surface
  glm::vec3 centre_{0};
  float reach_ = 0;  // radius of a sphere around the scene
  std::vector<Emitter> emitters_;
  glm::dvec3 power_{0};
};

// What one task sends, and what becomes of it.
struct Batch {
  std::uint64_t begin = 0, end = 0;  // photons
  std::vector<Photon> stored;
  std::uint64_t escaped = 0, lost_at_backs = 0;
};

// Follows photons. Immutable; safe from any thread.
class PhotonTracer {
 public:
  PhotonTracer(const Mesh& mesh, const RayScene& scene, const Emitters& emitters,
               const PhotonTracingOptions& options)
      : mesh_(mesh), scene_(scene), emitters_(emitters), options_(options) {}

  const Mesh& mesh() const { return mesh_; }

  void trace(Batch& batch) const {
    for (std::uint64_t i = batch.begin; i < batch.end; ++i) {
      PhotonRandom random(options_.seed, i);
      glm::vec3 power;
      const Ray ray = emitters_.emit(i, options_.photons, random, power);
      follow(ray, power, random, batch);
    }
  }

 private:
  void follow(Ray ray, glm::vec3 power, PhotonRandom& random, Batch& batch) const {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    for (;;) {
      const auto hit = scene_.closestHit(ray.origin, ray.direction, 0, kFar);
      if (!hit) {
        ++batch.escaped;
        return;
      }
      // Backs block and reflect nothing, as they do in the direct light of surfels
      const SurfacePoint point = surfacePoint(mesh_, hit->triangle, hit->u, hit->v);
      if (glm::dot(point.geometric_normal, ray.direction) >= 0) {
        ++batch.lost_at_backs;
        return;
      }
      batch.stored.push_back({point.position, point.normal, power, ray.direction, point.albedo});

      // Absorbed, or reflected with the power that makes up for those that were absorbed
      const glm::vec3 reflected = power * point.albedo;
      const float survival = std::min(largest(reflected) / largest(power), kMostSurvival);
      if (!(random.next() < survival)) return;
      power = reflected / survival;
      ray.origin = point.position + scene_.surfaceOffset() * point.geometric_normal;
      ray.direction = cosineDirection(point.normal, random);
      // Shading normals lean over their surface's edge: what would pass into it stays above
      const float height = glm::dot(ray.direction, point.geometric_normal);
      if (height < 0) ray.direction -= 2 * height * point.geometric_normal;
    }
  }

  const Mesh& mesh_;
  const RayScene& scene_;
  const Emitters& emitters_;
  const PhotonTracingOptions& options_;
};

// Sends, follows and writes in a pipeline: batches are dealt and written in order, followed in
// parallel.
Status writePhotons(const PhotonTracer& tracer, const PhotonTracingOptions& options, int threads,
                    RowWriter& writer, Progress& progress, PhotonTracingStats& stats) {
  Status status;
  std::atomic<bool> has_failed = false;
  std::uint64_t next = 0;
  using BatchPtr = std::shared_ptr<Batch>;  // not unique: an exception must free what is in flight
  const auto deal = [&](tbb::flow_control& control) {
    auto batch = std::make_shared<Batch>();
    batch->begin = next;
    next += std::min(kBatchPhotons, options.photons - next);
    batch->end = next;
    if (has_failed || progress.isCancelled() || batch->begin == batch->end) control.stop();
    return batch;
  };
  const auto follow = [&](BatchPtr batch) {
    tracer.trace(*batch);
    return batch;
  };
  const auto write = [&](BatchPtr batch) {
    if (!status.ok()) return;
    status = writeRows(batch->stored, tracer.mesh().origin, writer);
    has_failed = !status.ok();
    stats.emitted += batch->end - batch->begin;
    stats.stored += batch->stored.size();
    stats.escaped += batch->escaped;
    stats.lost_at_backs += batch->lost_at_backs;
    for (const Photon& photon : batch->stored) stats.stored_power += glm::dvec3(photon.power);
    progress.advance(batch->end - batch->begin);
  };
  tbb::parallel_pipeline(
      kBatchesInFlightPerThread * std::size_t(threads),
      tbb::make_filter<void, BatchPtr>(tbb::filter_mode::serial_in_order, deal) &
          tbb::make_filter<BatchPtr, BatchPtr>(tbb::filter_mode::parallel, follow) &
          tbb::make_filter<BatchPtr, void>(tbb::filter_mode::serial_in_order, write));
  if (status.ok() && progress.isCancelled()) return Status::interrupted();
  return status;
}

Status checkOptions(const PhotonTracingOptions& options) {
  if (options.photons < 1 || options.photons > kMostPhotons) {
    return Status::invalidArgument(fmt::format("photons {}: expected 1 to 2^40", options.photons));
  }
  return checkSurroundings(options.surroundings);
}

}  // namespace

Result<PhotonTracingStats> tracePhotons(const std::vector<std::string>& meshes,
                                        const std::string& output,
                                        const PhotonTracingOptions& options, Progress& progress) {
  if (meshes.empty()) return Status::invalidArgument("sample: no mesh");
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  PhotonTracingStats stats;
  stats.threads = options.threads > 0 ? options.threads : defaultThreadCount();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  std::size_t(stats.threads));
  try {
    requireThreads(stats.threads);
    auto start = std::chrono::steady_clock::now();
    progress.beginPhase("load", 0, "triangles");
    SURFEIT_ASSIGN_OR_RETURN(const Mesh mesh, loadScene(meshes, options.surroundings, progress));
    stats.triangles = mesh.triangle.size();
    stats.degenerate_faces = mesh.degenerate_faces;
    stats.load_seconds = secondsSince(start);

    start = std::chrono::steady_clock::now();
    progress.beginPhase("build", 0, "triangles");
    SURFEIT_ASSIGN_OR_RETURN(const RayScene scene, RayScene::build(mesh, stats.threads));
    const Emitters emitters(mesh, scene, options.surroundings.lights);
    if (emitters.isEmpty()) {
      return Status::invalidArgument(fmt::format(
          "{}: no light and nothing emits, expected a light to send photons (--light-*, "
          "or a material with Ke)",
          meshes.front()));
    }
    stats.emitted_power = emitters.power();
    stats.build_seconds = secondsSince(start);

    start = std::chrono::steady_clock::now();
    progress.beginPhase("trace", options.photons, "photons");
    RowWriterOptions writing;
    writing.properties = photonProperties(mesh.origin != glm::dvec3(0));
    writing.comments = {upComment(options.surroundings.ground.up)};
    writing.progress = &progress;
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer,
                             createRowWriter(output, writing));
    std::set<std::string> told;
    const auto noteOfWriter = [&] {
      for (const std::string& note : writer->notes()) {
        if (told.insert(note).second) progress.note(output + ": " + note);
      }
    };
    noteOfWriter();
    const PhotonTracer tracer(mesh, scene, emitters, options);
    SURFEIT_RETURN_IF_ERROR(writePhotons(tracer, options, stats.threads, *writer, progress, stats));
    if (stats.stored == 0) {
      return Status::invalidArgument(fmt::format(
          "{}: none of {} photons met the front of a surface", meshes.front(), stats.emitted));
    }
    SURFEIT_RETURN_IF_ERROR(writer->finish());
    noteOfWriter();
    stats.trace_seconds = secondsSince(start);
  } catch (const std::bad_alloc&) {
    return Status::failed(fmt::format("{}: out of memory", output));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", output, error.what()));
  }
  return stats;
}

}  // namespace surfeit
