// The scene of a gather: a file that is opened for it, or one whose caches an earlier gather has
// filled (surfeit/kept_scene.h).
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "batch/gather_job.h"
#include "batch/gather_memory.h"
#include "batch/result_store.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "storage/external_sorter.h"
#include "surfeit/bake.h"
#include "surfeit/kept_scene.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Between two gathers. `octree` is null where no scene is kept.
struct KeptScene::State {
  std::unique_ptr<PagedOctree> octree;
  std::string path;
  Access access = Access::kCached;
  struct ::stat file {};  // as it was when it was opened
};

// One thread at a time.
class GatherScene {
 public:
  // What readers and writers of clouds may take beside caches that are kept.
  static constexpr std::uint64_t kBesideBytes = 8 << 20;

  // Takes the scene out of `kept` (may be null) where it is this one, or opens it. Errors: as
  // openSceneFor.
  static Result<GatherScene> open(const std::string& scene_path, const std::string& result_path,
                                  const GatherOptions& options, KeptScene::State* kept,
                                  Progress& progress);

  const SceneFile& file() const { return octree_ != nullptr ? octree_->file() : *file_; }

  // Makes room for all but the caches: pages of an earlier gather stay as far as the plan of the
  // job has memory for them, and it sorts beside them. They go where the plan divides otherwise.
  // Errors: those of opening the scene again.
  Status makeRoom(GatherJob& job);
  // Gathers at the receivers of the sorter in caches as the plan has them, and completes the
  // statistics. Then the octree is kept for the next gather, and makes room; without `kept`, and
  // where the writer of the result takes the memory of the caches, it goes. Once. Errors: as
  // SortedGather.
  Status gather(const GatherJob& job, ExternalSorter& sorter, ResultStore& results,
                GatherStats& stats, Progress& progress);

 private:
  explicit GatherScene(KeptScene::State* kept) : kept_(kept) {}
  Result<std::unique_ptr<PagedOctree>> takeOctree(const PagedOctree::Memory& plan);
  void keep(std::unique_ptr<PagedOctree> octree, const GatherMemory& memory);

  KeptScene::State* kept_;
  std::string path_;
  Access access_ = Access::kCached;
  PageStage::Options stage_;
  struct ::stat identity_ {};
  std::optional<SceneFile> file_;
  std::unique_ptr<PagedOctree> octree_;
};

}  // namespace surfeit
