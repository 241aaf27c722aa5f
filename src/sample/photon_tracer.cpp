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
#include "cloud/rows/photon_names.h"
#include "cloud/rows/row_writer.h"
#include "cloud/rows/surfel_names.h"
#include "core/job_limits.h"
#include "core/luminance.h"
#include "core/seconds_since.h"
#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"
#include "core/thread_check.h"
#include "core/up_comment.h"
#include "sample/direct_light.h"
#include "sample/photon_random.h"
#include "sample/photon_scatter.h"
#include "sample/ray_scene.h"
#include "sample/surroundings.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

// Photons that are sent at once; batches are cut by count, so that tasks do not depend on threads.
constexpr std::uint64_t kBatchPhotons = 1024;
constexpr std::size_t kBatchesInFlightPerThread = 4;
constexpr std::uint64_t kMostPhotons = std::uint64_t{1} << 40;

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
      const glm::dvec3 exitance(meanEmission(mesh, std::uint32_t(i)));
      add(Kind::kTriangle, i, triangleArea(mesh, std::uint32_t(i)) * exitance);
    }
  }

  bool isEmpty() const { return emitters_.empty(); }
  glm::dvec3 power() const { return power_; }

  // Photon number `index` of `count`: its ray, and its power. Emitters are chosen systematically by
  // luminance, so that each sends the share that it should but for less than one photon.
  void emit(std::uint64_t index, std::uint64_t count, PhotonRandom& random, PhotonRay& ray) const {
    const double total = emitters_.back().luminance_sum;
    const double target = (double(index) + 0.5) / double(count) * total;
    const auto chosen = std::upper_bound(
        emitters_.begin(), emitters_.end() - 1, target,
        [](double value, const Emitter& emitter) { return value < emitter.luminance_sum; });
    const double probability = luminance(chosen->power) / total;
    ray.power = glm::vec3(chosen->power / (probability * double(count)));
    sendFrom(*chosen, random, ray);
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

  void sendFrom(const Emitter& emitter, PhotonRandom& random, PhotonRay& ray) const {
    switch (emitter.kind) {
      case Kind::kPoint:
        ray.origin = glm::vec3(lights_.points[emitter.index].position);
        ray.direction = sphereDirection(random);
        return;
      case Kind::kDirectional: {
        // From a disk before the scene that covers it
        ray.direction = glm::normalize(lights_.directionals[emitter.index].direction);
        const TangentFrame frame(ray.direction);
        const glm::vec2 p = reach_ * diskPoint(random);
        ray.origin =
            centre_ - 1.01f * reach_ * ray.direction + p.x * frame.tangent + p.y * frame.bitangent;
        return;
      }
      case Kind::kArea: {
        const AreaLight& light = lights_.areas[emitter.index];
        const float u = 2 * random.next() - 1, v = 2 * random.next() - 1;
        const glm::vec3 normal = glm::normalize(glm::cross(light.u, light.v));
        ray.origin = glm::vec3(light.centre) + u * light.u + v * light.v + offset_ * normal;
        ray.direction = cosineDirection(normal, random);
        return;
      }
      case Kind::kTriangle:
        sendFromTriangle(std::uint32_t(emitter.index), emitter.power, random, ray);
    }
  }

  // Where a texture glows decides the part of the power that the photon takes.
  void sendFromTriangle(std::uint32_t triangle, const glm::dvec3& power, PhotonRandom& random,
                        PhotonRay& ray) const {
    // Uniform on the triangle: 1 - sqrt(u) weighs the first corner
    const float root = std::sqrt(random.next()), v = random.next();
    const SurfacePoint point = surfacePoint(mesh_, triangle, root * (1 - v), root * v);
    if (mesh_.materials[mesh_.triangle_material[triangle]].glow != kNoTexture) {
      const glm::vec3 mean(power / triangleArea(mesh_, triangle));
      for (int i = 0; i < 3; ++i) ray.power[i] *= mean[i] > 0 ? point.emission[i] / mean[i] : 0;
    }
    ray.origin = point.position + offset_ * point.geometric_normal;
    ray.direction = cosineDirection(point.geometric_normal, random);
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
  std::vector<Photon> stored, caustic;
  glm::dvec3 stored_power{0}, caustic_power{0};
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
      PhotonRay ray;
      emitters_.emit(i, options_.photons, random, ray);
      const float largest = std::max({ray.power.x, ray.power.y, ray.power.z});
      if (largest > 0) follow(ray, random, batch);  // not from where a lamp is black
    }
  }

 private:
  void follow(PhotonRay ray, PhotonRandom& random, Batch& batch) const {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    bool was_diffuse = false, was_specular = false;
    for (;;) {
      const auto hit = scene_.closestHit(ray.origin, ray.direction, 0, kFar);
      if (!hit) {
        ++batch.escaped;
        return;
      }
      ScatterPoint at;
      at.point = surfacePoint(mesh_, hit->triangle, hit->u, hit->v);
      at.material = &mesh_.materials[mesh_.triangle_material[hit->triangle]];
      at.is_back = glm::dot(at.point.geometric_normal, ray.direction) >= 0;
      // Backs block and reflect nothing, as they do in the direct light of surfels
      if (!scattersSide(at)) {
        ++batch.lost_at_backs;
        return;
      }
      if (storesPhotons(at)) store(at, ray, was_specular && !was_diffuse, batch);
      const auto kind = scatter(at, scene_.surfaceOffset(), random, ray);
      if (!kind) return;
      (*kind == ScatterKind::kDiffuse ? was_diffuse : was_specular) = true;
    }
  }

  // What passes through a translucent sheet arrives at its other side, too, whose radiosity is the
  // light let through.
  void store(const ScatterPoint& at, const PhotonRay& ray, bool is_caustic, Batch& batch) const {
    const bool is_apart = is_caustic && !options_.caustic_output.empty();
    std::vector<Photon>& photons = is_apart ? batch.caustic : batch.stored;
    const glm::vec3 normal = at.is_back ? -at.point.normal : at.point.normal;
    photons.push_back({at.point.position, normal, ray.power, ray.direction, at.point.albedo});
    (is_apart ? batch.caustic_power : batch.stored_power) += glm::dvec3(ray.power);
    if (at.material->scattering != Scattering::kTranslucent) return;
    const glm::vec3 mirrored = ray.direction - 2 * glm::dot(ray.direction, normal) * normal;
    photons.push_back({at.point.position, -normal, ray.power, mirrored, at.material->transmission});
  }

  const Mesh& mesh_;
  const RayScene& scene_;
  const Emitters& emitters_;
  const PhotonTracingOptions& options_;
};

// The photon map, and the map of caustics where it is apart.
class PhotonFiles {
 public:
  static Result<PhotonFiles> create(const std::string& output, const PhotonTracingOptions& options,
                                    bool is_far, Progress& progress) {
    PhotonFiles files(progress);
    SURFEIT_RETURN_IF_ERROR(files.add(output, options, is_far));
    if (!options.caustic_output.empty()) {
      SURFEIT_RETURN_IF_ERROR(files.add(options.caustic_output, options, is_far));
    }
    return files;
  }

  Status write(std::span<const Photon> stored, std::span<const Photon> caustic,
               const glm::dvec3& origin) {
    SURFEIT_RETURN_IF_ERROR(writeRows(stored, origin, *files_[0].writer));
    if (files_.size() == 1) return {};
    return writeRows(caustic, origin, *files_[1].writer);
  }

  std::uint64_t temporaryBytes() const {
    std::uint64_t bytes = 0;
    for (const File& file : files_) bytes += file.writer->temporaryBytes();
    return bytes;
  }

  Status finish() {
    for (File& file : files_) {
      SURFEIT_RETURN_IF_ERROR(file.writer->finish());
      tellNotes(file);
    }
    return {};
  }

 private:
  struct File {
    std::string path;
    std::unique_ptr<RowWriter> writer;
    std::set<std::string> told;
  };

  explicit PhotonFiles(Progress& progress) : progress_(&progress) {}

  Status add(const std::string& path, const PhotonTracingOptions& options, bool is_far) {
    RowWriterOptions writing;
    writing.properties = photonProperties(is_far);
    writing.comments = {upComment(options.surroundings.ground.up)};
    writing.progress = progress_;
    files_.push_back({path, nullptr, {}});
    SURFEIT_ASSIGN_OR_RETURN(files_.back().writer, createRowWriter(path, writing));
    tellNotes(files_.back());
    return {};
  }

  void tellNotes(File& file) {
    for (const std::string& note : file.writer->notes()) {
      if (file.told.insert(note).second) progress_->note(file.path + ": " + note);
    }
  }

  Progress* progress_;
  std::vector<File> files_;
};

// Sends, follows and writes in a pipeline: batches are dealt and written in order, followed in
// parallel.
Status writePhotons(const PhotonTracer& tracer, const PhotonTracingOptions& options, int threads,
                    PhotonFiles& files, Progress& progress, PhotonTracingStats& stats) {
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
    status = files.write(batch->stored, batch->caustic, tracer.mesh().origin);
    has_failed = !status.ok();
    stats.emitted += batch->end - batch->begin;
    stats.stored += batch->stored.size();
    stats.escaped += batch->escaped;
    stats.lost_at_backs += batch->lost_at_backs;
    stats.caustic += batch->caustic.size();
    stats.stored_power += batch->stored_power;
    stats.caustic_power += batch->caustic_power;
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
  if (options.surroundings.lights.falloff != 2) {
    return Status::invalidArgument(fmt::format(
        "falloff of lights {}: photons spread, so that their light always falls off with the "
        "square of the distance: expected 2",
        options.surroundings.lights.falloff));
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
    SURFEIT_ASSIGN_OR_RETURN(
        PhotonFiles files,
        PhotonFiles::create(output, options, mesh.origin != glm::dvec3(0), progress));
    if (mesh.hasTints()) {
      progress.note(
          "some materials let colors through differently (Tf beside d): photons of all colors pass "
          "them as the mean of the three does");
    }
    const PhotonTracer tracer(mesh, scene, emitters, options);
    SURFEIT_RETURN_IF_ERROR(writePhotons(tracer, options, stats.threads, files, progress, stats));
    if (stats.stored + stats.caustic == 0) {
      return Status::invalidArgument(fmt::format(
          "{}: none of {} photons met the front of a surface", meshes.front(), stats.emitted));
    }
    if (stats.caustic == 0 && !options.caustic_output.empty()) {
      progress.note(fmt::format(
          "{}: no photon came over a mirror or through glass (illum 3 to 9 in MTL): it is empty",
          options.caustic_output));
    }
    SURFEIT_RETURN_IF_ERROR(files.finish());
    stats.temporary_bytes = files.temporaryBytes();
    stats.trace_seconds = secondsSince(start);
  } catch (const std::bad_alloc&) {
    return Status::failed(fmt::format("{}: out of memory", output));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", output, error.what()));
  }
  return stats;
}

}  // namespace surfeit
