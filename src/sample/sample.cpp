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
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cloud/rows/comment_notes.h"
#include "core/crs_comment.h"
#include "core/group_comment.h"
#include "core/job_limits.h"
#include "core/seconds_since.h"
#include "core/spherical_harmonics.h"
#include "core/thread_check.h"
#include "core/up_comment.h"
#include "sample/camera_dice.h"
#include "sample/dice.h"
#include "sample/direct_light.h"
#include "sample/ray_scene.h"
#include "sample/surfel_maker.h"
#include "sample/surroundings.h"
#include "surfels/camera_spacing.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr std::size_t kTasksInFlightPerThread = 4;

// Cuts, lights and writes in a pipeline: tasks are dealt and their surfels written in order, made
// in parallel.
Status writeSurfels(SurfelTasks& tasks, int threads, SurfelWriter& writer, Progress& progress,
                    SampleStats& stats) {
  struct Batch : SurfelBatch {
    std::unique_ptr<SurfelTask> task;
  };
  Status status;
  std::atomic<bool> has_failed = false;
  using BatchPtr = std::shared_ptr<Batch>;  // not unique: an exception must free what is in flight
  const auto deal = [&](tbb::flow_control& control) {
    auto batch = std::make_shared<Batch>();
    if (!has_failed && !progress.isCancelled()) batch->task = tasks.next();
    if (batch->task == nullptr) control.stop();
    return batch;
  };
  const auto make = [&](BatchPtr batch) {
    batch->task->fill(*batch);
    for (const Surfel& surfel : batch->surfels) {
      batch->disk_area += double(kPi) * double(surfel.radius) * double(surfel.radius);
    }
    return batch;
  };
  const auto write = [&](BatchPtr batch) {
    if (!status.ok()) return;
    status = writer.write(batch->surfels);
    has_failed = !status.ok();
    stats.surfels += batch->surfels.size();
    stats.disk_area += batch->disk_area;
    stats.clear_surfels += batch->clear;
    for (const Surfel& surfel : batch->surfels) stats.surfel_area += double(surfel.area);
    progress.advance(batch->surfels.size());
  };
  tbb::parallel_pipeline(
      kTasksInFlightPerThread * std::size_t(threads),
      tbb::make_filter<void, BatchPtr>(tbb::filter_mode::serial_in_order, deal) &
          tbb::make_filter<BatchPtr, BatchPtr>(tbb::filter_mode::parallel, make) &
          tbb::make_filter<BatchPtr, void>(tbb::filter_mode::serial_in_order, write));
  if (status.ok() && progress.isCancelled()) return Status::interrupted();
  return status;
}

Status checkOptions(const SampleOptions& options) {
  if (!(options.spacing >= 0) || !std::isfinite(options.spacing)) {
    return Status::invalidArgument(
        fmt::format("spacing {}: expected a positive length", options.spacing));
  }
  if (options.spacing > 0 && !options.density.cameras.empty()) {
    return Status::invalidArgument("found both a spacing and cameras, expected one of them");
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

// How far from an eye surfels stop to become smaller, as a part of the scene's diagonal. As the
// near plane of pictures.
constexpr double kNearFraction = 1e-5;

// What the cloud says of itself, and the system of the meshes.
std::vector<std::string> commentsOf(const Mesh& mesh, UpAxis up, Progress& progress) {
  std::vector<std::string> comments = {upComment(up)};
  for (std::size_t i = 0; i < mesh.group_names.size(); ++i) {
    comments.push_back(groupComment(i + 1, mesh.group_names[i]));
  }
  if (const auto stated = statedUpAxis(mesh.comments); stated && *stated != up) {
    progress.note(fmt::format("the mesh says that {0} is up, the cloud says {1}: --up {0} says so",
                              upAxisName(*stated), upAxisName(up)));
  }
  for (const std::string& note : notesOfComments(mesh.comments)) progress.note(note);
  // Places stay those of the system; all else is said of the mesh, not of the cloud made of it
  std::uint64_t lost = mesh.other_comments;
  for (const std::string& comment : mesh.comments) {
    const bool is_known = statedUpAxis(std::span(&comment, 1)) || statedGroupName(comment);
    if (comment.starts_with(kCrsComment)) {
      comments.push_back(comment);
    } else if (!is_known) {
      ++lost;
    }
  }
  if (lost > 0) progress.inform(fmt::format("{} comments of the meshes are not kept", lost));
  return comments;
}

// The ways to cut the mesh that options may ask for.
class Cutting {
 public:
  static Result<std::unique_ptr<Cutting>> create(const Mesh& mesh, const SampleOptions& options) {
    auto cutting = std::make_unique<Cutting>();
    if (!options.density.cameras.empty()) {
      const double diagonal = double(glm::length(mesh.bounds().extent()));
      SURFEIT_ASSIGN_OR_RETURN(
          cutting->spacing_, CameraSpacing::create(options.density, options.surroundings.ground.up,
                                                   mesh.origin, kNearFraction * diagonal));
      cutting->dice_ = std::make_unique<CameraDice>(mesh, *cutting->spacing_);
      return cutting;
    }
    SURFEIT_ASSIGN_OR_RETURN(const std::uint64_t count, surfelCountFor(options, totalArea(mesh)));
    cutting->plan_ = std::make_unique<DicePlan>(mesh, count);
    return cutting;
  }

  std::unique_ptr<SurfelTasks> tasks(const SurfelMaker& maker) const {
    if (plan_ != nullptr) return makePlanTasks(*plan_, maker);
    return makeCameraTasks(*dice_, maker, trianglesAlongCurve(maker.mesh()));
  }
  // Root of the area per surfel: as planned, or where no number is planned as it came out.
  double spacing(double area, std::uint64_t surfels) const {
    if (plan_ != nullptr) return plan_->spacing();
    return std::sqrt(area / double(std::max<std::uint64_t>(surfels, 1)));
  }
  // Asked for; 0: not known before.
  std::uint64_t surfelCount() const { return plan_ != nullptr ? plan_->surfelCount() : 0; }

 private:
  std::optional<CameraSpacing> spacing_;
  std::unique_ptr<CameraDice> dice_;
  std::unique_ptr<DicePlan> plan_;
};

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
    SURFEIT_ASSIGN_OR_RETURN(const Mesh mesh,
                             loadScene(meshes, options.surroundings, progress, options.groups));
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
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<Cutting> cutting,
                             Cutting::create(mesh, options));
    stats.area = totalArea(mesh);
    stats.build_seconds = secondsSince(start);

    start = std::chrono::steady_clock::now();
    progress.beginPhase("sample", cutting->surfelCount(), "surfels");
    CloudChannels channels;
    channels.normal = channels.radius = channels.area = channels.albedo = true;
    channels.radiosity = light.hasLight();
    channels.two_sided = channels.long_side = options.is_two_sided || mesh.hasTwoSides();
    channels.opacity = mesh.isTranslucent();
    channels.tint = mesh.hasTints();
    channels.group = options.groups != SampleGroups::kNone;
    SURFEIT_ASSIGN_OR_RETURN(
        SurfelWriter writer,
        SurfelWriter::create(
            output, channels,
            {.comments = commentsOf(mesh, options.surroundings.ground.up, progress),
             .progress = &progress},
            mesh.origin));
    const SurfelMaker maker(mesh, light.hasLight() ? &light : nullptr, options.is_two_sided);
    const std::unique_ptr<SurfelTasks> tasks = cutting->tasks(maker);
    SURFEIT_RETURN_IF_ERROR(writeSurfels(*tasks, stats.threads, writer, progress, stats));
    const std::uint64_t pieces = stats.surfels + stats.clear_surfels;
    stats.spacing = cutting->spacing(stats.area, pieces);
    if (cutting->surfelCount() > 0) stats.sliver_surfels = pieces - cutting->surfelCount();
    if (stats.surfels == 0 && stats.clear_surfels == 0) {
      return Status::invalidArgument(fmt::format(
          "{}: {} triangles are together smaller than a surfel for these cameras: come closer, or "
          "give fewer pixels or a smaller max solid angle",
          meshes.front(), stats.triangles));
    }
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
    stats.temporary_bytes = writer.temporaryBytes();
    stats.sample_seconds = secondsSince(start);
  } catch (const std::bad_alloc&) {
    return Status::failed(fmt::format("{}: out of memory", output));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", output, error.what()));
  }
  return stats;
}

}  // namespace surfeit
