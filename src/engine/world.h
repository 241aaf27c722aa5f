// What gatherers of the same scenes and settings share.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "engine/engine_state.h"
#include "gather/cut/instance_tree.h"
#include "gather/light/environment_map.h"
#include "gather/rules/gather_rules.h"
#include "surfeit/engine.h"

namespace surfeit {

// Immutable once made; holds its scenes, and its part of the engine's budget.
class World {
 public:
  // Errors: as Engine::gatherer.
  static Result<std::shared_ptr<const World>> create(std::shared_ptr<EngineState> engine,
                                                     const std::vector<Instance>& instances,
                                                     const GatherSettings& settings,
                                                     const EnvironmentPixels* environment);
  // Of one scene in its own coordinates, for a job (engine/planned_scene.h). `rules` count from the
  // scene's origin; their environment must outlive the world.
  static std::shared_ptr<const World> ofPlanned(std::shared_ptr<SceneState> scene,
                                                const GatherRules& rules);
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World();

  EngineState& engine() const { return *engine_; }
  const GatherRules& rules() const { return *rules_; }
  // What receivers are counted from.
  const glm::dvec3& origin() const { return origin_; }
  // Null for one scene in its own coordinates, which is then the only one.
  const InstanceTree* instances() const { return tree_ ? &*tree_ : nullptr; }
  const std::vector<const PagedOctree*>& octrees() const { return octrees_; }
  // Of the first scene, which is the only one where there are no instances.
  const SceneFile& file() const { return octrees_.front()->file(); }
  // Bytes that a gatherer takes.
  std::uint64_t gathererBytes() const { return gatherer_bytes_; }

 private:
  explicit World(std::shared_ptr<EngineState> engine) : engine_(std::move(engine)) {}
  Status loadEnvironment(const EnvironmentPixels& pixels, const GatherSettings& settings);
  void addScenes(const std::vector<Instance>& instances);
  Status placeInstances(const std::vector<Instance>& instances);
  Status take(std::uint64_t bytes, const std::string& what);

  const std::shared_ptr<EngineState> engine_;
  std::vector<Scene> scenes_;  // each once
  std::vector<const PagedOctree*> octrees_;
  std::vector<std::uint32_t> scene_of_;  // by instance
  glm::dvec3 origin_{0};
  std::optional<InstanceTree> tree_;
  std::unique_ptr<LoadedEnvironment> environment_;
  std::optional<GatherRules> rules_;
  std::uint64_t held_bytes_ = 0, gatherer_bytes_ = 0;
};

}  // namespace surfeit
