// What the handles of an engine share: the budget, the caches, and who uses them.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "engine/cache_monitor.h"
#include "octree/read/octree_caches.h"
#include "octree/read/paged_octree.h"
#include "surfeit/engine.h"

namespace surfeit {

struct EngineState {
  EngineState(const EngineOptions& given, std::unique_ptr<OctreeCaches> made);
  // Of a job that has planned its memory (engine/planned_scene.h): the caches keep the limits that
  // they have, until the monitor moves them, and nothing is taken off them.
  EngineState(std::shared_ptr<OctreeCaches> planned, std::size_t front_slots,
              const CacheMonitor::Options& monitoring);

  // Takes bytes off the caches for `what`, and makes room for so many more gatherers.
  // kBudgetTooSmall with the budget that would do.
  Status take(std::uint64_t bytes, int more_gatherers, const std::string& what);
  void giveBack(std::uint64_t bytes, int fewer_gatherers);
  // Divides what is left between the caches again: pages have come or gone.
  void divide();

  // Pages that a gatherer may hold in front of each cache.
  std::size_t frontSlots() const;

  const EngineOptions options;  // with defaults filled in
  const std::shared_ptr<OctreeCaches> caches;
  CacheMonitor monitor;
  std::atomic<std::uint32_t> scene_count{0};

  mutable std::mutex mutex;
  std::uint64_t held_bytes = 0;  // guarded by mutex, as is what follows
  int gatherer_count = 0;

 private:
  // mutex held
  std::uint64_t leastCacheBytes(int gatherers) const;
  void divideFrames();

  const std::optional<std::size_t> planned_front_slots_;
};

struct SceneState {
  explicit SceneState(std::shared_ptr<EngineState> of) : engine(std::move(of)) {
    ++engine->scene_count;
  }
  SceneState(const SceneState&) = delete;
  SceneState& operator=(const SceneState&) = delete;
  ~SceneState();

  const std::shared_ptr<EngineState> engine;
  std::uint64_t held_bytes = 0;  // of the engine's budget
  std::unique_ptr<PagedOctree> octree;
  SceneInfo info;
};

// For those of the library who need what is behind a handle.
struct EngineAccess {
  static const SceneState& state(const Scene& scene) { return *scene.state_; }
  static Scene handle(std::shared_ptr<SceneState> scene) { return Scene(std::move(scene)); }
};

}  // namespace surfeit
