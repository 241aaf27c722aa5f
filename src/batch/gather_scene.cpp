#include "batch/gather_scene.h"

#include <algorithm>
#include <span>
#include <utility>

#include "batch/gather_crew.h"
#include "batch/gather_options.h"

namespace surfeit {
namespace {

bool isSame(const struct ::stat& a, const struct ::stat& b) {
  const auto isSameTime = [](const timespec& s, const timespec& t) {
    return s.tv_sec == t.tv_sec && s.tv_nsec == t.tv_nsec;
  };
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino && a.st_size == b.st_size &&
         isSameTime(a.st_mtim, b.st_mtim) && isSameTime(a.st_ctim, b.st_ctim);
}

std::uint64_t frameBytes(OctreeCaches& caches, std::size_t nodes, std::size_t surfels) {
  return nodes * caches.nodeFrameBytes() + surfels * caches.surfelFrameBytes();
}

std::uint64_t plannedBytes(OctreeCaches& caches, const PagedOctree::Memory& plan) {
  return frameBytes(caches, plan.node_frames, plan.surfel_frames);
}

// Caches that were made for one plan serve another that differs by less than this part.
constexpr std::size_t kLikePart = 8;

bool isLike(PagedOctree& octree, const PagedOctree::Memory& plan) {
  const PagedOctree::Memory& made = octree.memory();
  const auto isNear = [](std::size_t a, std::size_t b) {
    return (a > b ? a - b : b - a) <= a / kLikePart;
  };
  return plan.front_slots == made.front_slots && plan.tracked_pages == made.tracked_pages &&
         isNear(made.node_frames, plan.node_frames) &&
         isNear(made.surfel_frames, plan.surfel_frames);
}

// What the frames of a plan take while others read and write, beside what the plan leaves over
// where it has room for every page.
std::uint64_t keptBytes(OctreeCaches& caches, const GatherMemory& memory) {
  constexpr std::uint64_t kPageBytes = 64;  // of the tables, at most
  const std::uint64_t planned = plannedBytes(caches, memory.caches);
  const std::uint64_t pages =
      std::uint64_t{caches.nodes().pageCount()} + caches.surfels().pageCount();
  const std::uint64_t used = planned + kPageBytes * pages;
  const std::uint64_t left = memory.cache_bytes - std::min(memory.cache_bytes, used);
  const std::uint64_t beside =
      GatherScene::kBesideBytes - std::min(GatherScene::kBesideBytes, left);
  return planned - std::min(planned, beside);
}

// Sets both limits so that the frames take no more than `bytes`, divided as they are now. False,
// and nothing is changed, where the plan needs more.
bool limitFrames(PagedOctree& octree, const PagedOctree::Memory& plan, std::uint64_t bytes) {
  OctreeCaches& caches = octree.caches();
  PageCache &nodes = caches.nodes(), &surfels = caches.surfels();
  const std::size_t node_bytes = caches.nodeFrameBytes(), surfel_bytes = caches.surfelFrameBytes();
  const std::uint64_t both = frameBytes(caches, nodes.frameLimit(), surfels.frameLimit());
  const std::size_t least_nodes =
      std::max<std::size_t>(plan.least_node_frames, octree.memory().resident_node_pages + 1);
  const std::uint64_t least_surfels = plan.least_surfel_frames * surfel_bytes;
  if (least_nodes * node_bytes + least_surfels > bytes) return false;
  const double share = double(bytes) / double(both);
  const std::size_t most_nodes =
      std::min<std::size_t>(nodes.pageCount(), (bytes - least_surfels) / node_bytes);
  const std::size_t node_frames =
      std::clamp<std::size_t>(std::size_t(double(nodes.frameLimit()) * share + 0.5),
                              std::min(least_nodes, most_nodes), most_nodes);
  const std::size_t surfel_frames =
      std::min<std::size_t>(surfels.pageCount(), (bytes - node_frames * node_bytes) / surfel_bytes);
  caches.setFrameLimits(node_frames, surfel_frames);
  return true;
}

}  // namespace

Result<GatherScene> GatherScene::open(const std::string& scene_path, const std::string& result_path,
                                      const GatherOptions& options, KeptScene::State* kept,
                                      Progress& progress) {
  GatherScene scene(kept);
  scene.path_ = scene_path;
  scene.access_ = sceneAccess(options);
  scene.stage_ = {options.stage_directory, options.stage_limit_bytes};
  // A file that is replaced between this look and the opening is opened again by the next gather
  const bool is_there = ::stat(scene_path.c_str(), &scene.identity_) == 0;
  if (kept != nullptr && kept->octree != nullptr) {
    std::unique_ptr<PagedOctree> octree = std::move(kept->octree);
    if (is_there && kept->path == scene_path && kept->access == scene.access_ &&
        isSame(kept->file, scene.identity_)) {
      SURFEIT_RETURN_IF_ERROR(checkSceneFor(octree->file(), result_path, options, progress));
      scene.octree_ = std::move(octree);
      return scene;
    }
  }
  SURFEIT_ASSIGN_OR_RETURN(SceneFile file,
                           openSceneFor(scene_path, result_path, options, progress));
  scene.file_.emplace(std::move(file));
  return scene;
}

Status GatherScene::makeRoom(GatherJob& job) {
  if (octree_ == nullptr) return {};
  const GatherMemory& memory = job.memory();
  const std::uint64_t bytes = std::min(keptBytes(octree_->caches(), memory),
                                       plannedBytes(octree_->caches(), octree_->memory()));
  if (isLike(*octree_, memory.caches) && limitFrames(*octree_, memory.caches, bytes)) {
    job.sortBesideCaches();
    return {};
  }
  octree_ = nullptr;
  SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(path_, access_));
  file.stage(stage_);
  file_.emplace(std::move(file));
  return {};
}

Result<std::unique_ptr<PagedOctree>> GatherScene::takeOctree(const PagedOctree::Memory& plan) {
  if (octree_ == nullptr) return PagedOctree::create(*std::exchange(file_, std::nullopt), plan);
  // No more than at first, for which there is address space
  OctreeCaches& caches = octree_->caches();
  limitFrames(*octree_, plan,
              std::min(plannedBytes(caches, plan), plannedBytes(caches, octree_->memory())));
  return std::move(octree_);
}

Status GatherScene::gather(const GatherJob& job, ExternalSorter& sorter, ResultStore& results,
                           GatherStats& stats, Progress& progress) {
  const bool is_warm = octree_ != nullptr;
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree, takeOctree(job.memory().caches));
  std::unique_ptr<SortedGather> gather = SortedGather::create(
      std::move(octree), is_warm, job.memory(), job.options(), stats, progress, job.environment());
  SURFEIT_RETURN_IF_ERROR(gather->gather(
      sorter, [&](std::span<const ResultStore::Entry> entries) { return results.put(entries); }));
  gather->finish();
  octree = gather->takeOctree();
  gather.reset();
  if (kept_ != nullptr && !job.writerTakesCaches()) keep(std::move(octree), job.memory());
  return {};
}

void GatherScene::keep(std::unique_ptr<PagedOctree> octree, const GatherMemory& memory) {
  OctreeCaches& caches = octree->caches();
  const std::uint64_t bytes =
      std::min(keptBytes(caches, memory),
               frameBytes(caches, caches.nodes().frameLimit(), caches.surfels().frameLimit()));
  if (!limitFrames(*octree, memory.caches, bytes)) return;
  kept_->octree = std::move(octree);
  kept_->path = path_;
  kept_->access = access_;
  kept_->file = identity_;
}

}  // namespace surfeit
