#include "engine/planned_scene.h"

#include <utility>

namespace surfeit {

CacheMonitor::Options monitoring(const PagedOctree::Memory& plan, bool adapts_split, bool is_warm) {
  return {.adapts_split = adapts_split,
          .is_warm = is_warm,
          .least_node_frames = plan.least_node_frames,
          .least_surfel_frames = plan.least_surfel_frames};
}

Result<std::shared_ptr<SceneState>> openPlanned(SceneFile file, const PagedOctree::Memory& plan,
                                                const CacheMonitor::Options& options) {
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<PagedOctree> octree,
                           PagedOctree::create(std::move(file), plan));
  return plannedScene(std::move(octree), options);
}

std::shared_ptr<SceneState> plannedScene(std::unique_ptr<PagedOctree> octree,
                                         const CacheMonitor::Options& options) {
  auto scene = std::make_shared<SceneState>(
      std::make_shared<EngineState>(octree->sharedCaches(), octree->memory().front_slots, options));
  scene->octree = std::move(octree);
  return scene;
}

}  // namespace surfeit
