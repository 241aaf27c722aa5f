// The engine of a job from files to files. A job plans all of its memory before it begins, caches
// and gatherers included (PagedOctree::Memory), and works on one scene in caches of its own. So
// nothing is taken off its budget later, and only the monitor divides the caches anew.
#pragma once

#include <memory>

#include "engine/cache_monitor.h"
#include "engine/engine_state.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/status.h"

namespace surfeit {

// Of caches that are as the plan has them.
CacheMonitor::Options monitoring(const PagedOctree::Memory& plan, bool adapts_split,
                                 bool is_warm = false);

// Opens the caches that are planned. Errors: as PagedOctree::create.
Result<std::shared_ptr<SceneState>> openPlanned(SceneFile file, const PagedOctree::Memory& plan,
                                                const CacheMonitor::Options& options);
// In caches that are open. The octree may be taken out of the scene when no world of it is left.
std::shared_ptr<SceneState> plannedScene(std::unique_ptr<PagedOctree> octree,
                                         const CacheMonitor::Options& options);

}  // namespace surfeit
