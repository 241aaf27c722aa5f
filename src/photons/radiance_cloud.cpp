// Photons to surfels with radiosity. The photons are indexed like surfels, so that neighbours are
// found in a paged octree within the budget; estimates are made page by page along the curve, by
// any thread, and written in that order.
//
//   photons --by name--> surfel cloud --index--> paged octree --estimate (all threads)--> surfels
//                        (temporary)             (temporary)

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "cloud/cloud_formats.h"
#include "core/first_failure.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/program_memory.h"
#include "core/spherical_harmonics.h"
#include "core/up_comment.h"
#include "index/steps/index_plan.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "photons/nearest_photons.h"
#include "photons/radiance_estimate.h"
#include "photons/radiance_photons.h"
#include "storage/file.h"
#include "storage/output_target.h"
#include "storage/temporary_name.h"
#include "surfeit/index.h"
#include "surfeit/radiance.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kMostPhotonsPerEstimate = 10000;
constexpr std::uint32_t kLeafCapacity = 16;
// Estimates reach at most this many times as far as the median one: over densities of 1 : 256.
constexpr float kFarthestReach = 16;
constexpr std::uint32_t kSamplePages = 64;
constexpr std::size_t kOthers = 32;
// Buffers of the file being written.
constexpr std::uint64_t kStreamBytes = std::uint64_t{6} << 20;
// Stack and allocator of a thread, and the pages that it has under way.
constexpr std::uint64_t kThreadBytes = std::uint64_t{256} << 10;
constexpr std::size_t kResultRowBytes = 3 * sizeof(double) + 11 * sizeof(float);

Status checkOptions(const RadianceOptions& options) {
  const auto refuse = [](const char* what, auto found, const std::string& expected) {
    return Status::invalidArgument(fmt::format("{} is {}, expected {}", what, found, expected));
  };
  // No NaN passes any of these
  if (options.photons_per_estimate < 1 || options.photons_per_estimate > kMostPhotonsPerEstimate) {
    return refuse("photons per estimate", options.photons_per_estimate,
                  fmt::format("1 to {}", kMostPhotonsPerEstimate));
  }
  if (!(options.max_radius >= 0) || !std::isfinite(options.max_radius)) {
    return refuse("max radius", options.max_radius, "0 or more scene units");
  }
  for (int i = 0; i < 3; ++i) {
    if (options.default_albedo[i] >= 0 && options.default_albedo[i] <= 1) continue;
    return refuse("albedo", options.default_albedo[i], "0 to 1");
  }
  if (!(options.disk_overlap >= 1 && options.disk_overlap <= 16)) {
    return refuse("disk overlap", options.disk_overlap, "1 to 16");
  }
  SURFEIT_RETURN_IF_ERROR(checkThreadCount(options.threads));
  return {};
}

NearestPhotonSearch searchFor(const RadianceOptions& options) {
  return {.count = options.photons_per_estimate};
}

// Photons of other surfaces, few of which tell where a disk must end.
NearestPhotonSearch searchForOthers(const NearestPhotonSearch& search) {
  return {.count = kOthers,
          .max_distance = search.max_distance,
          .min_cosine = search.min_cosine,
          .takes_others = true,
          .stretch = kOthersStretch};
}

std::uint64_t threadBytes(const RadianceOptions& options) {
  return kThreadBytes + NearestPhotons::memoryBytes(searchFor(options)) +
         NearestPhotons::memoryBytes(searchForOthers({})) +
         (2 * std::uint64_t{options.photons_per_estimate} + 3) * sizeof(glm::dvec2);
}

// A name for a file that must have one for a while; the file is removed with this.
class TemporaryName {
 public:
  static Result<TemporaryName> create(const std::string& directory,
                                      const std::string& result_path) {
    const std::string name = result_path.substr(result_path.rfind('/') + 1);
    SURFEIT_ASSIGN_OR_RETURN(NamedFile file, createTemporary(directory + '/' + name, directory));
    return TemporaryName(std::move(file));
  }
  TemporaryName(TemporaryName&& other) noexcept : file_(std::exchange(other.file_, std::nullopt)) {}
  TemporaryName& operator=(TemporaryName&&) = delete;
  ~TemporaryName() {
    std::error_code ignored;
    if (file_) std::filesystem::remove(file_->path, ignored);
  }
  const std::string& path() const { return file_->path; }

 private:
  explicit TemporaryName(NamedFile file) : file_(std::move(file)) {}
  std::optional<NamedFile> file_;  // locked, so that nobody takes it for a leftover
};

class RadianceJob {
 public:
  RadianceJob(const RadianceOptions& options, Progress& progress)
      : options_(options), search_(searchFor(options)), progress_(progress) {}

  Result<RadianceStats> run(const std::vector<std::string>& inputs, const std::string& result_path);

 private:
  // What a thread estimates with.
  struct Worker {
    Worker(PagedOctree& octree, const NearestPhotonSearch& search)
        : reader(octree), nearest(search), others(searchForOthers(search)), estimator(search) {}
    PagedOctree::Reader reader;
    NearestPhotons nearest, others;
    RadianceEstimator estimator;
  };
  // A page under way, and what the statistics want to know of it.
  struct PageWork {
    std::uint32_t page = 0;
    std::vector<Surfel> surfels;
    std::uint64_t sparse = 0, bounded = 0;
    double radius_sum = 0;
  };

  Status planThreads();
  Result<SurfelWriter> createWriter(const std::string& result_path, std::uint64_t most_surfels,
                                    const glm::dvec3& origin, Progress* told);
  Result<SceneFile> indexPhotons(PhotonCloud photons, const std::string& result_path);
  Result<std::unique_ptr<PagedOctree>> openOctree(SceneFile scene) const;
  Result<float> medianRadius(PagedOctree& octree) const;
  Status estimateAll(PagedOctree& octree, SurfelWriter& writer);
  Status estimatePage(Worker& worker, PageWork& work) const;
  Status boundDisk(Worker& worker, Surfel& surfel, PageWork& work) const;
  Status writePage(const PageWork& work, SurfelWriter& writer);
  std::unique_ptr<Worker> takeWorker(PagedOctree& octree);
  void giveBack(std::unique_ptr<Worker> worker);
  void finishPhase(const char* name);

  const RadianceOptions& options_;
  NearestPhotonSearch search_;
  Progress& progress_;
  RadianceStats stats_;
  std::uint64_t held_bytes_ = 0;  // by the writer, at most
  UpAxis up_ = kDefaultUpAxis;
  std::chrono::steady_clock::time_point phase_begin_ = std::chrono::steady_clock::now();

  std::mutex mutex_;  // guards what follows
  std::vector<std::unique_ptr<Worker>> idle_workers_;
};

Result<RadianceStats> RadianceJob::run(const std::vector<std::string>& inputs,
                                       const std::string& result_path) {
  // Everything that can be refused is, before work starts
  SURFEIT_ASSIGN_OR_RETURN(PhotonCloud photons,
                           PhotonCloud::open(inputs, options_.channels, options_.part,
                                             options_.filter, options_.color_range));
  up_ = photons.up();
  SURFEIT_RETURN_IF_ERROR(planThreads());
  // A name that cannot be written is refused before the work
  const std::uint64_t records = photons.recordCount();
  SURFEIT_RETURN_IF_ERROR(createWriter(result_path, records, glm::dvec3(0), nullptr).status());

  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, indexPhotons(std::move(photons), result_path));
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer,
                           createWriter(result_path, records, scene.header().origin, &progress_));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree, openOctree(std::move(scene)));
  search_.max_distance = options_.max_radius;
  if (options_.max_radius == 0) {
    SURFEIT_ASSIGN_OR_RETURN(const float median, medianRadius(*octree));
    search_.max_distance = kFarthestReach * median;
  }
  stats_.max_radius = double(search_.max_distance);
  Status status;
  withThreads(stats_.threads, [&] { status = estimateAll(*octree, writer); });
  idle_workers_.clear();
  SURFEIT_RETURN_IF_ERROR(status);
  SURFEIT_RETURN_IF_ERROR(writer.finish());
  stats_.mean_radius /= double(stats_.surfels);
  finishPhase("estimate");
  return stats_;
}

// Threads do not show in the result: a budget that does not feed all gets fewer.
Status RadianceJob::planThreads() {
  stats_.memory_bytes = options_.memory_bytes != 0 ? options_.memory_bytes : defaultMemoryBytes();
  if (stats_.memory_bytes < kLeastIndexMemory) {
    return Status::budgetTooSmall(
        fmt::format("a memory budget of {:.1f} MiB is too small for an index of photons: {} MiB is "
                    "the least that works",
                    double(stats_.memory_bytes) / (1 << 20), kLeastIndexMemory >> 20));
  }
  const int wanted = options_.threads != 0 ? options_.threads : defaultThreadCount();
  const std::uint64_t most = stats_.memory_bytes / 4 / threadBytes(options_);
  stats_.threads = static_cast<int>(std::clamp<std::uint64_t>(most, 1, std::uint64_t(wanted)));
  if (stats_.threads < wanted) {
    progress_.inform(fmt::format("{} of {} threads: a budget of {} MiB feeds no more",
                                 stats_.threads, wanted, stats_.memory_bytes >> 20));
  }
  return {};
}

Result<SurfelWriter> RadianceJob::createWriter(const std::string& result_path,
                                               std::uint64_t most_surfels, const glm::dvec3& origin,
                                               Progress* told) {
  CloudChannels channels;
  channels.normal = channels.radius = channels.area = channels.radiosity = channels.albedo = true;
  held_bytes_ = heldWriterBytes(result_path, most_surfels, kResultRowBytes);
  RowWriterOptions writing;
  if (held_bytes_ > 0) writing.count = most_surfels;  // so that too many are refused at once
  writing.comments = {upComment(up_)};
  writing.memory_parts = 2;
  writing.memory_beside_bytes = programBytes(stats_.threads);
  writing.memory_bytes =
      (stats_.memory_bytes - std::min(stats_.memory_bytes, writing.memory_beside_bytes)) / 2;
  writing.progress = told;
  return SurfelWriter::create(result_path, channels, std::move(writing), origin);
}

// The photons as a scene, open and without a name.
Result<SceneFile> RadianceJob::indexPhotons(PhotonCloud photons, const std::string& result_path) {
  const std::string directory = temporaryDirectory(options_.temporary_directory, result_path);
  stats_.photons = photons.recordCount();
  SURFEIT_RETURN_IF_ERROR(photons.write(
      directory, result_path,
      {.default_albedo = options_.default_albedo, .strict = options_.strict}, progress_));
  stats_.skipped_photons = photons.skippedCount();
  stats_.power = photons.power();
  if (stats_.power == glm::dvec3(0)) {
    progress_.note(fmt::format(
        "{}: all photons have a power of 0, so the result is black: give photons with power_r "
        "power_g power_b (--channels FROM=power reads another channel)",
        result_path));
  }
  finishPhase("read");

  IndexOptions index_options;
  index_options.memory_bytes = stats_.memory_bytes;
  index_options.threads = threadsWithin(
      stats_.memory_bytes, {kLeafCapacity, /* full_precision= */ true}, stats_.threads);
  index_options.leaf_capacity = kLeafCapacity;
  index_options.full_precision = true;  // radii next to nothing ask for it, and powers deserve it
  index_options.temporary_directory = directory;
  SURFEIT_ASSIGN_OR_RETURN(const TemporaryName name, TemporaryName::create(directory, result_path));
  SURFEIT_ASSIGN_OR_RETURN(const IndexStats index,
                           indexClouds({photons.path()}, name.path(), index_options, progress_));
  if (index.surfels != photons.photonCount()) {
    return Status::failed(fmt::format("{}: {} photons indexed, expected {}: this is a bug",
                                      result_path, index.surfels, photons.photonCount()));
  }
  stats_.temporary_bytes = photons.fileBytes() + index.temporary_bytes + index.file_bytes;
  finishPhase("index");
  return SceneFile::open(name.path());
}

Result<std::unique_ptr<PagedOctree>> RadianceJob::openOctree(SceneFile scene) const {
  const std::uint64_t fixed = programBytes(stats_.threads) +
                              PagedOctree::fixedBytes(scene, stats_.threads) + kStreamBytes +
                              held_bytes_ + std::uint64_t(stats_.threads) * threadBytes(options_);
  const std::uint64_t least = fixed + PagedOctree::leastCacheBytes(scene, stats_.threads);
  if (stats_.memory_bytes < least) {
    return Status::budgetTooSmall(fmt::format(
        "a memory budget of {:.1f} MiB is too small for {} photons with {} threads: {:.1f} MiB is "
        "the least that works",
        double(stats_.memory_bytes) / (1 << 20), scene.header().surfel_count, stats_.threads,
        double(least) / (1 << 20) + 0.1));
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const PagedOctree::Memory memory,
      PagedOctree::planMemory(scene, stats_.memory_bytes - fixed, stats_.threads));
  return PagedOctree::create(std::move(scene), memory);
}

// Of the disks that hold as many photons as an estimate, whatever their normals, so that no photon
// without like neighbours makes the search run through the whole cloud.
Result<float> RadianceJob::medianRadius(PagedOctree& octree) const {
  const SceneHeader& header = octree.file().header();
  const std::uint32_t pages = octree.file().surfelPageCount();
  NearestPhotons nearest({.count = search_.count, .min_cosine = -2, .stretch = 1});
  PagedOctree::Reader reader(octree);
  std::vector<float> radii;
  for (std::uint32_t page = 0; page < pages; page += std::max(1u, pages / kSamplePages)) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> photons,
                             reader.surfels(page, 0, NearestPhotons::kMostCentres));
    const std::vector<Surfel> centres(photons.begin(), photons.end());
    SURFEIT_RETURN_IF_ERROR(nearest.find(centres, reader));
    for (std::size_t i = 0; i < centres.size(); ++i) {
      float radius_sq = 0;
      for (const NearestPhoton& photon : nearest.nearest(i)) {
        radius_sq = std::max(radius_sq, photon.distance_sq);
      }
      if (radius_sq > 0) radii.push_back(std::sqrt(radius_sq));
    }
  }
  // One position for all: any size will do, so take a thousandth of the scene
  if (radii.empty()) return float(header.cube.size) * 1e-3f;
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  return *median;
}

Status RadianceJob::estimateAll(PagedOctree& octree, SurfelWriter& writer) {
  const std::uint32_t page_count = octree.file().surfelPageCount();
  std::vector<PageWork> works(2 * static_cast<std::size_t>(stats_.threads));
  FirstFailure failure;
  std::uint32_t next_page = 0;
  progress_.beginPhase("estimate", octree.file().header().surfel_count, "photons");

  const auto deal = [&]() -> std::optional<std::size_t> {
    if (progress_.isCancelled()) failure.note(Status::interrupted());
    if (failure.happened() || next_page == page_count) return std::nullopt;
    // A slot comes again when its page is written, and pages are written in order
    const std::size_t slot = next_page % works.size();
    works[slot].page = next_page++;
    return slot;
  };
  const auto estimate = [&](std::size_t slot) {
    if (failure.happened()) return;
    std::unique_ptr<Worker> worker = takeWorker(octree);
    failure.note(estimatePage(*worker, works[slot]), works[slot].page);
    giveBack(std::move(worker));
  };
  const auto write = [&](std::size_t slot) {
    if (!failure.happened()) failure.note(writePage(works[slot], writer), works[slot].page);
  };
  const PipelineStage stages[] = {{PipelineStage::Mode::kParallel, estimate},
                                  {PipelineStage::Mode::kInOrder, write}};
  runPipeline(works.size(), deal, stages);
  return failure.status();
}

// The surfels of a page.
Status RadianceJob::estimatePage(Worker& worker, PageWork& work) const {
  const std::size_t capacity = NearestPhotons::kMostCentres;
  SURFEIT_ASSIGN_OR_RETURN(
      const std::span<const Surfel> photons,
      worker.reader.surfels(work.page, 0, std::numeric_limits<std::uint64_t>::max()));
  work.surfels.assign(photons.begin(), photons.end());
  work.sparse = work.bounded = 0;
  work.radius_sum = 0;
  for (std::size_t begin = 0; begin < work.surfels.size(); begin += capacity) {
    const std::span<Surfel> run =
        std::span(work.surfels).subspan(begin, std::min(capacity, work.surfels.size() - begin));
    SURFEIT_RETURN_IF_ERROR(worker.nearest.find(run, worker.reader));
    for (std::size_t i = 0; i < run.size(); ++i) {
      const RadianceEstimate estimate = worker.estimator.estimate(worker.nearest.nearest(i));
      run[i].area = estimate.area;
      run[i].radius = std::sqrt(options_.disk_overlap * estimate.area / kPi);
      run[i].radiosity = run[i].albedo * estimate.irradiance;
      if (estimate.is_sparse) SURFEIT_RETURN_IF_ERROR(boundDisk(worker, run[i], work));
      work.sparse += estimate.is_sparse ? 1 : 0;
      work.radius_sum += double(estimate.radius);
    }
  }
  worker.reader.release();  // this thread may wait now, and hold no page meanwhile
  return {};
}

// Of a photon with few neighbours on its own surface: a disk that would stick out of it, or through
// others, hides what lies behind. Its power stays.
Status RadianceJob::boundDisk(Worker& worker, Surfel& surfel, PageWork& work) const {
  SURFEIT_RETURN_IF_ERROR(worker.others.find({&surfel, 1}, worker.reader));
  // Not below the disk of a photon at the median density
  const float usual = search_.max_distance / kFarthestReach *
                      std::sqrt(options_.disk_overlap / float(search_.count));
  const float most = std::max(distanceToOthers(worker.others.nearest(0)), usual);
  if (surfel.radius <= most) return {};
  ++work.bounded;
  surfel.radius = most;
  const float most_area = kPi * most * most;
  if (surfel.area <= most_area) return {};
  surfel.radiosity *= surfel.area / most_area;
  surfel.area = most_area;
  return {};
}

Status RadianceJob::writePage(const PageWork& work, SurfelWriter& writer) {
  SURFEIT_RETURN_IF_ERROR(writer.write(work.surfels));
  stats_.surfels += work.surfels.size();
  stats_.sparse_surfels += work.sparse;
  stats_.bounded_surfels += work.bounded;
  stats_.mean_radius += work.radius_sum;
  for (const Surfel& surfel : work.surfels) {
    stats_.area += double(surfel.area);
    stats_.reflected_power += glm::dvec3(surfel.radiosity) * double(surfel.area);
  }
  progress_.advance(work.surfels.size());
  return {};
}

// One that is idle, or a new one: never more than there are threads.
std::unique_ptr<RadianceJob::Worker> RadianceJob::takeWorker(PagedOctree& octree) {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_workers_.empty()) {
      std::unique_ptr<Worker> worker = std::move(idle_workers_.back());
      idle_workers_.pop_back();
      return worker;
    }
  }
  return std::make_unique<Worker>(octree, search_);
}

void RadianceJob::giveBack(std::unique_ptr<Worker> worker) {
  const std::lock_guard lock(mutex_);
  idle_workers_.push_back(std::move(worker));
}

void RadianceJob::finishPhase(const char* name) {
  const auto now = std::chrono::steady_clock::now();
  stats_.phase_seconds.emplace_back(name,
                                    std::chrono::duration<double>(now - phase_begin_).count());
  phase_begin_ = now;
}

}  // namespace

Result<RadianceStats> radianceCloud(const std::vector<std::string>& photon_paths,
                                    const std::string& result_path, const RadianceOptions& options,
                                    Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  for (const std::string& photons : photon_paths) {
    SURFEIT_RETURN_IF_ERROR(checkReplacesNot(result_path, photons, "photons"));
  }
  return guarded(result_path, [&]() -> Result<RadianceStats> {
    return RadianceJob(options, progress).run(photon_paths, result_path);
  });
}

}  // namespace surfeit
