// The scene of a gather: a file that is opened for it, or one whose caches an earlier gather has
// filled (surfeit/kept_scene.h).
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "batch/gather_memory.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/kept_scene.h"
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
  // Whether pages of an earlier gather are there.
  bool isWarm() const { return octree_ != nullptr; }

  // Makes room for all but the caches: pages that are there stay as far as the plan has memory for
  // them. They go where the plan divides otherwise. Errors: those of opening the scene again.
  Status makeRoom(const GatherMemory& memory);
  // The octree with caches as the plan has them. Then this has only the file's name.
  Result<std::unique_ptr<PagedOctree>> takeOctree(const PagedOctree::Memory& plan);
  // Keeps it for the next gather, and makes room. Without `kept` it goes.
  void keep(std::unique_ptr<PagedOctree> octree, const GatherMemory& memory);

 private:
  explicit GatherScene(KeptScene::State* kept) : kept_(kept) {}

  KeptScene::State* kept_;
  std::string path_;
  Access access_ = Access::kCached;
  PageStage::Options stage_;
  struct ::stat identity_ {};
  std::optional<SceneFile> file_;
  std::unique_ptr<PagedOctree> octree_;
};

}  // namespace surfeit
