#include "bench/internal/gather_scenes.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/job_limits.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

// Part of the names of scene files that are kept; raise it whenever a scene changes.
constexpr int kSceneVersion = 3;
constexpr std::size_t kDenseRuns = 64, kRunLength = 1024;
constexpr std::size_t kScattered = 50'000;
constexpr std::size_t kJudged = 2048;

// Pages of surfels, decoded one at a time.
class SurfelPages {
 public:
  explicit SurfelPages(const SceneFile& file)
      : file_(file), surfels_(file.header().surfel_group_capacity) {}

  std::uint32_t pageCount() const { return file_.surfelPageCount(); }
  // Valid until the next call.
  Result<std::span<const Surfel>> read(std::uint32_t page) {
    if (page != page_) {
      SURFEIT_ASSIGN_OR_RETURN(count_, file_.decodeSurfels(page, scratch_, surfels_));
      page_ = page;
    }
    return std::span<const Surfel>(surfels_).first(count_);
  }

 private:
  const SceneFile& file_;
  SceneFile::Scratch scratch_;
  std::vector<Surfel> surfels_;
  std::uint32_t page_ = ~std::uint32_t{0};
  std::uint32_t count_ = 0;
};

void addReceiver(const Surfel& surfel, ReceiverSet& set) {
  set.receivers.push_back({surfel.position, surfel.normal});
  set.radii.push_back(surfel.radius);
}

// Adds `count` surfels from the beginning of a page on, as far as there are that many.
Status addReceivers(SurfelPages& pages, std::uint32_t page, std::size_t count, ReceiverSet& set) {
  for (; count > 0 && page < pages.pageCount(); ++page) {
    SURFEIT_ASSIGN_OR_RETURN(std::span<const Surfel> surfels, pages.read(page));
    surfels = surfels.first(std::min(count, surfels.size()));
    for (const Surfel& surfel : surfels) addReceiver(surfel, set);
    count -= surfels.size();
  }
  return {};
}

void chooseJudged(ReceiverSet& set) {
  const std::size_t count = std::min(kJudged, set.receivers.size());
  for (std::size_t i = 0; i < count; ++i) {
    set.judged.push_back(std::uint32_t((2 * i + 1) * set.receivers.size() / (2 * count)));
  }
}

}  // namespace

const std::vector<std::string>& gatherSceneNames() {
  static const std::vector<std::string> names = {"spheres", "city",   "bunny", "lion",
                                                 "sponza",  "leaves", "hair"};
  return names;
}

const std::vector<std::string>& unseenSceneNames() {
  static const std::vector<std::string> names = {"koala",  "igea",      "dragon",   "cornell",
                                                 "scan",   "furniture", "terraces", "forest",
                                                 "shrubs", "grass",     "pipes",    "scales"};
  return names;
}

std::string missingSceneFile(const std::string& name, const SceneOptions& options) {
  if (!isMeshScene(name)) return {};
  std::string path = meshSceneFile(name, options.data);
  return std::filesystem::exists(path) ? std::string() : path;
}

Result<WorkDirectory> WorkDirectory::open(const std::string& keep) {
  if (keep.empty()) {
    std::string path = (std::filesystem::temp_directory_path() / "surfeit-bench-XXXXXX").string();
    if (mkdtemp(path.data()) == nullptr) {
      return Status::ioError(fmt::format("{}: {}", path, std::strerror(errno)));
    }
    return WorkDirectory(path, false);
  }
  std::error_code error;
  std::filesystem::create_directories(keep, error);
  if (error) return Status::ioError(fmt::format("{}: {}", keep, error.message()));
  return WorkDirectory(keep, true);
}

WorkDirectory::WorkDirectory(WorkDirectory&& other) noexcept
    : path_(std::move(other.path_)), is_kept_(std::exchange(other.is_kept_, true)) {}

WorkDirectory::~WorkDirectory() {
  std::error_code ignored;
  if (!is_kept_) std::filesystem::remove_all(path_, ignored);
}

Result<GatherScene> GatherScene::open(const std::string& name, const SceneOptions& options,
                                      Progress& progress) {
  const auto isOf = [&](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  if (!isOf(gatherSceneNames()) && !isOf(unseenSceneNames())) {
    return Status::invalidArgument(fmt::format("scene {}: expected one of {}, {}", name,
                                               fmt::join(gatherSceneNames(), ", "),
                                               fmt::join(unseenSceneNames(), ", ")));
  }
  SURFEIT_ASSIGN_OR_RETURN(WorkDirectory directory, WorkDirectory::open(options.keep));
  GatherScene scene(name, std::move(directory));
  if (isMeshScene(name)) {
    SURFEIT_ASSIGN_OR_RETURN(scene.geometry_, loadMeshScene(name, options.data, progress));
  } else if (isUnseenScene(name)) {
    scene.geometry_ = makeUnseenScene(name);
  } else {
    scene.geometry_ = name == "city" ? makeCity() : name == "leaves" ? makeLeaves() : makeSpheres();
  }
  const std::uint64_t count = options.surfels > 0 ? options.surfels : scene.geometry_.surfels;
  scene.octree_path_ =
      fmt::format("{}/{}_{}_v{}.sft", scene.directory_.path(), name, count, kSceneVersion);
  if (!std::filesystem::exists(scene.octree_path_)) {
    const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
    SURFEIT_RETURN_IF_ERROR(scene.makeOctree(count, threads, progress));
  }
  return scene;
}

Status GatherScene::makeOctree(std::uint64_t count, int threads, Progress& progress) const {
  const std::string cloud_path = octree_path_ + ".ply";
  CloudChannels channels;
  channels.normal = channels.radiosity = true;
  channels.radius = channels.area = name_ != "scan";  // that brings places and normals alone
  channels.two_sided = channels.long_side = geometry_.is_two_sided;
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer, SurfelWriter::create(cloud_path, channels));
  const SurfelSink sink = [&](std::span<const Surfel> surfels) { return writer.write(surfels); };
  if (isMeshScene(name_) || isUnseenScene(name_) || name_ == "leaves") {
    SURFEIT_RETURN_IF_ERROR(sendMeshSurfels(geometry_, count, octree_path_, threads, sink));
  } else if (name_ == "city") {
    SURFEIT_RETURN_IF_ERROR(sendCitySurfels(geometry_, count, sink));
  } else {
    SURFEIT_RETURN_IF_ERROR(sendSpheresSurfels(geometry_, count, sink));
  }
  SURFEIT_RETURN_IF_ERROR(writer.finish());

  IndexOptions index;
  index.threads = threads;
  index.origin = glm::dvec3(0);  // receivers and rays are about it
  index.memory_bytes = std::min<std::uint64_t>(memoryLimitBytes() / 2, std::uint64_t{4} << 30);
  SURFEIT_ASSIGN_OR_RETURN(const IndexStats stats,
                           indexClouds({cloud_path}, octree_path_, index, progress));
  static_cast<void>(stats);
  std::filesystem::remove(cloud_path);
  return {};
}

Result<std::unique_ptr<PagedOctree>> GatherScene::openOctree(int threads,
                                                             std::size_t cache_bytes) const {
  SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(octree_path_));
  if (cache_bytes == 0) cache_bytes = PagedOctree::unlimitedCacheBytes(file);
  SURFEIT_ASSIGN_OR_RETURN(const PagedOctree::Memory memory,
                           PagedOctree::planMemory(file, cache_bytes, threads));
  return PagedOctree::create(std::move(file), memory);
}

Result<ReceiverSet> denseReceivers(const SceneFile& file) {
  ReceiverSet set{.name = "dense", .run_length = kRunLength};
  SurfelPages pages(file);
  const std::uint32_t page_count = file.surfelPageCount();
  const std::uint32_t run_pages = kRunLength / file.header().surfel_group_capacity + 2;
  const std::size_t starts = page_count > run_pages ? page_count - run_pages : 1;
  const std::size_t runs = std::min(kDenseRuns, starts);
  for (std::size_t run = 0; run < runs; ++run) {
    const auto page = std::uint32_t((2 * run + 1) * starts / (2 * runs));
    SURFEIT_RETURN_IF_ERROR(addReceivers(pages, page, kRunLength, set));
  }
  chooseJudged(set);
  return set;
}

Result<ReceiverSet> consecutiveReceivers(const SceneFile& file, double first_part,
                                         std::size_t count) {
  ReceiverSet set{.name = "consecutive", .run_length = kRunLength};
  SurfelPages pages(file);
  const auto page = std::uint32_t(first_part * file.surfelPageCount());
  SURFEIT_RETURN_IF_ERROR(addReceivers(pages, page, count, set));
  return set;
}

Result<ReceiverSet> scatteredReceivers(const SceneFile& file) {
  const std::size_t count = std::min<std::size_t>(kScattered, file.header().surfel_count);
  ReceiverSet set{.name = "scattered", .run_length = (count + kDenseRuns - 1) / kDenseRuns};
  SurfelPages pages(file);
  for (std::size_t i = 0; i < count; ++i) {
    // Pages hold about as many surfels each
    const double along = (double(i) + 0.5) / double(count) * file.surfelPageCount();
    const auto page = std::uint32_t(along);
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> surfels, pages.read(page));
    addReceiver(surfels[std::size_t((along - page) * double(surfels.size()))], set);
  }
  chooseJudged(set);
  return set;
}

Result<ReceiverSet> chooseReceivers(const std::string& name, const SceneFile& file) {
  return name == "dense" ? denseReceivers(file) : scatteredReceivers(file);
}

Result<std::vector<Surfel>> allSurfels(const SceneFile& file) {
  std::vector<Surfel> all;
  all.reserve(file.header().surfel_count);
  SurfelPages pages(file);
  for (std::uint32_t page = 0; page < file.surfelPageCount(); ++page) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const Surfel> surfels, pages.read(page));
    all.insert(all.end(), surfels.begin(), surfels.end());
  }
  return all;
}

}  // namespace surfeit
