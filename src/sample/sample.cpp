#include "surfeit/sample.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <new>

#include "core/job_limits.h"
#include "core/long_side.h"
#include "core/seconds_since.h"
#include "core/spherical_harmonics.h"
#include "core/thread_check.h"
#include "core/up_comment.h"
#include "sample/dice.h"
#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "sample/surroundings.h"
#include "surfels/surfel_writer.h"

namespace surfeit {
namespace {

// Pieces [begin, end) of a triangle.
struct PieceRange {
  DiceJob job;
  std::uint64_t begin = 0, end = 0;
};

// What one task turns into surfels. Cut by counts alone, so that tasks, and with them the order of
// the surfels, do not depend on the threads.
struct Batch {
  std::vector<PieceRange> ranges;
  std::vector<Surfel> surfels;
  double disk_area = 0;
  std::uint64_t clear = 0;  // pieces of which nothing is there
};

// 512 pieces are 32 KiB of surfels; a batch of nothing but the worst slivers stays below 32 MiB.
constexpr std::uint64_t kBatchPieces = 512;
constexpr std::size_t kBatchesInFlightPerThread = 4;

// Deals the plan out in batches; a large triangle spans many. One thread at a time.
class BatchDealer {
 public:
  explicit BatchDealer(DicePlan& plan) : plan_(plan) {}

  // False at the end.
  bool next(Batch& batch) {
    std::uint64_t room = kBatchPieces;
    while (room > 0) {
      if (current_.begin == current_.end) {
        if (!plan_.next(current_.job)) break;
        current_.begin = 0;
        current_.end = current_.job.piece_count;
      }
      PieceRange range = current_;
      range.end = range.begin + std::min(room, range.end - range.begin);
      room -= range.end - range.begin;
      current_.begin = range.end;
      batch.ranges.push_back(range);
    }
    return !batch.ranges.empty();
  }

 private:
  DicePlan& plan_;
  PieceRange current_;
};

// Turns pieces into surfels. Immutable; safe from any thread.
class SurfelMaker {
 public:
  // `light` is null when nothing emits.
  SurfelMaker(const Mesh& mesh, const DicePlan& plan, const DirectLight* light, bool is_two_sided)
      : mesh_(mesh), plan_(plan), light_(light), is_two_sided_(is_two_sided) {}

  void fill(Batch& batch) const {
    for (const PieceRange& range : batch.ranges) addPieces(range, batch);
    for (const Surfel& surfel : batch.surfels) {
      batch.disk_area += double(kPi) * double(surfel.radius) * double(surfel.radius);
    }
  }

 private:
  // Area and reach of the triangles that have no surfels of their own.
  struct Carried {
    double area = 0;
    glm::dvec3 centroid{0};
    std::uint64_t piece = 0;  // that takes them over: the one nearest to their centroid
  };

  Carried gatherCarried(const DiceJob& job, const TriangleDice& dice) const {
    Carried carried;
    for (std::uint64_t i = job.carried_begin; i < job.carried_end; ++i) {
      const std::uint32_t triangle = plan_.order()[i];
      if (triangle == job.triangle) continue;
      const double area = triangleArea(mesh_, triangle);
      carried.area += area;
      carried.centroid += area * wholeTriangle(mesh_, triangle).centroid();
    }
    if (carried.area > 0) {
      carried.centroid /= carried.area;
      carried.piece = dice.pieceNear(carried.centroid);
    }
    return carried;
  }

  // Gives the carried area to the nearest of the surfels from `begin`, and widens its disk over the
  // carried triangles, so that they leave no holes. Those far away (the curve jumps now and then)
  // are left: a hole of their size is better than so large a disk.
  void takeOver(const DiceJob& job, const Carried& carried, std::vector<Surfel>& surfels,
                std::size_t begin) const {
    const glm::vec3 centroid(carried.centroid);
    Surfel& surfel = *std::min_element(
        surfels.begin() + std::ptrdiff_t(begin), surfels.end(), [&](const auto& a, const auto& b) {
          return glm::distance(a.position, centroid) < glm::distance(b.position, centroid);
        });
    surfel.area = float(double(surfel.area) + carried.area);
    const float reach = float(2 * plan_.spacing());
    for (std::uint64_t i = job.carried_begin; i < job.carried_end; ++i) {
      const std::uint32_t triangle = plan_.order()[i];
      if (triangle == job.triangle) continue;
      float radius = 0;
      for (int k = 0; k < 3; ++k) {
        const glm::vec3& corner = mesh_.position[mesh_.triangle[triangle][k]];
        radius = std::max(radius, glm::distance(corner, surfel.position));
      }
      if (radius <= reach) surfel.radius = std::max(surfel.radius, radius);
    }
  }

  Surfel makeSurfel(const SurfacePoint& point, const PiecePart& part, std::uint64_t seed) const {
    Surfel surfel;
    surfel.position = glm::vec3(part.centroid);
    surfel.normal = point.normal;
    surfel.radius = float(part.radius * (1 + 1e-6));  // still circumscribes after rounding
    surfel.area = std::max(float(part.area), std::numeric_limits<float>::min());  // never 0
    surfel.albedo = point.albedo;
    if (light_ != nullptr) surfel.radiosity = light_->exitance(point, seed, light_->samples());
    if (is_two_sided_) showBothSides(point, seed, part, surfel);
    return surfel;
  }

  // What has two sides has one radiosity, the mean of both.
  void showBothSides(SurfacePoint point, std::uint64_t seed, const PiecePart& part,
                     Surfel& surfel) const {
    surfel.flags |= kSurfelTwoSided;
    setLongSide(glm::vec3(part.long_side), surfel);
    if (light_ == nullptr) return;
    point.normal = -point.normal;
    point.geometric_normal = -point.geometric_normal;
    const glm::vec3 back = light_->exitance(point, seed, light_->samples());
    surfel.radiosity = 0.5f * (surfel.radiosity + back);
  }

  // Of the surfels from `begin`: nothing is there of what is clear.
  static void applyOpacity(const std::vector<float>& opacities, std::size_t begin, Batch& batch) {
    std::size_t kept = begin;
    for (std::size_t i = begin; i < batch.surfels.size(); ++i) {
      const float opacity = opacities[i - begin];
      if (!(opacity > 0)) continue;
      batch.surfels[kept] = batch.surfels[i];
      batch.surfels[kept].transparency = transparencyOf(double(opacity));
      ++kept;
    }
    batch.clear += batch.surfels.size() - kept;
    batch.surfels.resize(kept);
  }

  void addPieces(const PieceRange& range, Batch& batch) const {
    const DiceJob& job = range.job;
    std::vector<Surfel>& surfels = batch.surfels;
    std::vector<float> opacities;
    const Micropolygon whole = wholeTriangle(mesh_, job.triangle);
    const TriangleDice dice(whole, job.area, job.piece_count, plan_.spacing());
    const Carried carried = gatherCarried(job, dice);
    std::vector<PiecePart> parts;
    for (std::uint64_t i = range.begin; i < range.end; ++i) {
      parts.clear();
      dice.appendParts(i, parts);
      opacities.clear();
      const std::size_t begin = surfels.size();
      for (std::size_t k = 0; k < parts.size(); ++k) {
        const std::uint64_t seed = ((job.first_surfel + i) << kMaxSlabBits) + k;
        const SurfacePoint point =
            surfacePoint(mesh_, job.triangle, float(parts[k].weight.y), float(parts[k].weight.z));
        surfels.push_back(makeSurfel(point, parts[k], seed));
        opacities.push_back(point.opacity);
      }
      if (carried.area > 0 && i == carried.piece) takeOver(job, carried, surfels, begin);
      if (!mesh_.isOpaque()) applyOpacity(opacities, begin, batch);
    }
  }

  const Mesh& mesh_;
  const DicePlan& plan_;
  const DirectLight* light_;
  const bool is_two_sided_;
};

// Cuts, lights and writes in a pipeline: batches are dealt and written in order, lit in parallel.
Status writeSurfels(DicePlan& plan, const SurfelMaker& maker, int threads, SurfelWriter& writer,
                    Progress& progress, SampleStats& stats) {
  Status status;
  std::atomic<bool> has_failed = false;
  BatchDealer dealer(plan);
  using BatchPtr = std::shared_ptr<Batch>;  // not unique: an exception must free what is in flight
  const auto deal = [&](tbb::flow_control& control) {
    auto batch = std::make_shared<Batch>();
    if (has_failed || progress.isCancelled() || !dealer.next(*batch)) control.stop();
    return batch;
  };
  const auto light = [&](BatchPtr batch) {
    maker.fill(*batch);
    return batch;
  };
  const auto write = [&](BatchPtr batch) {
    if (!status.ok()) return;
    status = writer.write(batch->surfels);
    has_failed = !status.ok();
    stats.surfels += batch->surfels.size();
    stats.disk_area += batch->disk_area;
    stats.clear_surfels += batch->clear;
    progress.advance(batch->surfels.size());
  };
  tbb::parallel_pipeline(
      kBatchesInFlightPerThread * std::size_t(threads),
      tbb::make_filter<void, BatchPtr>(tbb::filter_mode::serial_in_order, deal) &
          tbb::make_filter<BatchPtr, BatchPtr>(tbb::filter_mode::parallel, light) &
          tbb::make_filter<BatchPtr, void>(tbb::filter_mode::serial_in_order, write));
  if (status.ok() && progress.isCancelled()) return Status::interrupted();
  return status;
}

Status checkOptions(const SampleOptions& options) {
  if (!(options.spacing >= 0) || !std::isfinite(options.spacing)) {
    return Status::invalidArgument(
        fmt::format("spacing {}: expected a positive length", options.spacing));
  }
  if (options.spacing == 0 && options.count == 0) {
    return Status::invalidArgument("count 0: expected at least 1 surfel");
  }
  return checkSurroundings(options.surroundings);
}

double totalArea(const Mesh& mesh) {
  double area = 0;
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    area += triangleArea(mesh, std::uint32_t(i));
  }
  return area;
}

// Surfels for that area. The numbers beyond 2^40 are left to a spacing mistyped.
Result<std::uint64_t> surfelCountFor(const SampleOptions& options, double area) {
  constexpr double kMaxCount = 0x1p40;
  const double count = options.spacing > 0
                           ? std::max(1.0, std::round(area / (options.spacing * options.spacing)))
                           : double(options.count);
  if (!(count <= kMaxCount)) {
    return Status::invalidArgument(
        fmt::format("{:.3g} surfels for an area of {:.6g}, expected at most 2^40", count, area));
  }
  return std::uint64_t(count);
}

}  // namespace

Result<SampleStats> sampleMeshes(const std::vector<std::string>& meshes, const std::string& output,
                                 const SampleOptions& options, Progress& progress) {
  if (meshes.empty()) return Status::invalidArgument("sample: no mesh");
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  SampleStats stats;
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
    const DirectLight light(mesh, scene, options.surroundings.lights);
    if (!light.hasLight()) {
      progress.note("no light and nothing emits: the cloud gets albedo but no radiosity");
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t count, surfelCountFor(options, totalArea(mesh)));
    DicePlan plan(mesh, count);
    stats.area = plan.totalArea();
    stats.spacing = plan.spacing();
    stats.build_seconds = secondsSince(start);

    start = std::chrono::steady_clock::now();
    progress.beginPhase("sample", plan.surfelCount(), "surfels");
    CloudChannels channels;
    channels.normal = channels.radius = channels.area = channels.albedo = true;
    channels.radiosity = light.hasLight();
    channels.two_sided = channels.long_side = options.is_two_sided;
    channels.opacity = !mesh.isOpaque();
    SURFEIT_ASSIGN_OR_RETURN(
        SurfelWriter writer,
        SurfelWriter::create(
            output, channels,
            {.comments = {upComment(options.surroundings.ground.up)}, .progress = &progress},
            mesh.origin));
    const SurfelMaker maker(mesh, plan, light.hasLight() ? &light : nullptr, options.is_two_sided);
    SURFEIT_RETURN_IF_ERROR(writeSurfels(plan, maker, stats.threads, writer, progress, stats));
    stats.sliver_surfels = stats.surfels + stats.clear_surfels - plan.surfelCount();
    if (stats.surfels == 0) {
      return Status::invalidArgument(
          fmt::format("{}: all materials are clear (d, Tr, map_d): there is nothing to sample",
                      meshes.front()));
    }
    if (stats.clear_surfels > 0) {
      progress.inform(
          fmt::format("{}: {} surfels lie where materials are clear (d, Tr, map_d): left out",
                      output, stats.clear_surfels));
    }
    SURFEIT_RETURN_IF_ERROR(writer.finish());
    stats.sample_seconds = secondsSince(start);
  } catch (const std::bad_alloc&) {
    return Status::failed(fmt::format("{}: out of memory", output));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", output, error.what()));
  }
  return stats;
}

}  // namespace surfeit
