#include "surfeit/engine.h"

#include <fmt/format.h>

#include <utility>

#include "core/guard.h"
#include "core/job_limits.h"
#include "engine/world.h"
#include "octree/page/page_limits.h"
#include "octree/read/scene_info.h"

namespace surfeit {
namespace {

// Pages of all scenes that an engine may have open: 500 million nodes, 4 billion surfels. Tables
// for them take memory where they are used.
constexpr PageNumber kNodePages = 1u << 22, kSurfelPages = 1u << 23;
// Of these, so many are sampled for reuse distances.
constexpr std::size_t kTrackedPages = 1 << 16;
// An entry of a cache's table.
constexpr std::uint64_t kPageTableBytes = 16;

OctreeCaches::Options cacheOptions(const EngineOptions& options) {
  const std::size_t node_lobes = options.lobes ? sizeof(NodeLobes) : 0;
  const std::size_t surfel_lobe = options.lobes ? sizeof(Lobe) : 0;
  return {.node_page_bytes = kDefaultNodeGroup * (sizeof(Node) + node_lobes),
          .surfel_page_bytes = kDefaultSurfelGroup * (sizeof(Surfel) + surfel_lobe),
          .node_pages = kNodePages,
          .surfel_pages = kSurfelPages,
          .node_frames = 1,
          .surfel_frames = 1,
          .most_bytes = options.memory_bytes,
          .tracked_pages = kTrackedPages};
}

// What an engine holds without a scene.
std::uint64_t emptyEngineBytes() {
  return ReuseDistances::memoryBytes(kNodePages, kTrackedPages) +
         ReuseDistances::memoryBytes(kSurfelPages, kTrackedPages) + CacheMonitor::memoryBytes();
}

std::uint64_t sceneBytes(const SceneFile& file) {
  return PagedOctree::fixedBytes(file, 0) +
         kPageTableBytes * (std::uint64_t{file.nodePageCount()} + file.surfelPageCount());
}

Access accessOf(const EngineOptions& options) {
  return options.direct_io ? Access::kDirect : Access::kCached;
}

// Arrays of structs.
class StructArrays : public ReceiverArray {
 public:
  StructArrays(const Receiver* receivers, std::size_t count, GatherResult* results)
      : receivers_(receivers), count_(count), results_(results) {}

  std::size_t count() const override { return count_; }
  Receiver receiver(std::size_t index) const override { return receivers_[index]; }
  void setResult(std::size_t index, const GatherResult& result) override {
    results_[index] = result;
  }

 private:
  const Receiver* const receivers_;
  const std::size_t count_;
  GatherResult* const results_;
};

}  // namespace

Result<Engine> Engine::create(const EngineOptions& given) {
  return guarded("engine", [&]() -> Result<Engine> {
    EngineOptions options = given;
    SURFEIT_RETURN_IF_ERROR(checkThreadCount(options.threads));
    if (options.threads == 0) options.threads = defaultThreadCount();
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes();
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<OctreeCaches> caches,
                             OctreeCaches::create(cacheOptions(options)));
    const auto state = std::make_shared<EngineState>(options, std::move(caches));
    SURFEIT_RETURN_IF_ERROR(state->take(emptyEngineBytes(), 0, "an engine without a scene"));
    return Engine(state);
  });
}

Result<Scene> Engine::open(const std::string& path) {
  return guarded(path, [&]() -> Result<Scene> {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(path, accessOf(state_->options)));
    return add(std::move(file));
  });
}

Result<Scene> Engine::openBytes(const void* bytes, std::size_t size, const std::string& name) {
  return guarded(name, [&]() -> Result<Scene> {
    const Bytes content(static_cast<const std::byte*>(bytes), size);
    SURFEIT_ASSIGN_OR_RETURN(InputFile held, InputFile::fromBytes(content, name));
    SURFEIT_ASSIGN_OR_RETURN(PageFile pages, PageFile::open(std::move(held)));
    SURFEIT_ASSIGN_OR_RETURN(SceneFile file, SceneFile::open(std::move(pages)));
    return add(std::move(file), size);
  });
}

Result<Scene> Engine::add(SceneFile file, std::uint64_t more_bytes) {
  const auto scene = std::make_shared<SceneState>(state_);
  SURFEIT_ASSIGN_OR_RETURN(scene->info, sceneInfo(file));
  const std::uint64_t bytes = sceneBytes(file) + more_bytes;
  SURFEIT_RETURN_IF_ERROR(state_->take(bytes, 0, file.path()));
  scene->held_bytes = bytes;
  SURFEIT_ASSIGN_OR_RETURN(scene->octree, PagedOctree::share(std::move(file), state_->caches));
  state_->divide();
  return Scene(scene);
}

Result<Gatherer> Engine::gatherer(const Scene& scene, const GatherSettings& settings,
                                  const EnvironmentPixels* environment) {
  return gatherer({Instance{scene, {}}}, settings, environment);
}

Result<Gatherer> Engine::gatherer(const std::vector<Instance>& instances,
                                  const GatherSettings& settings,
                                  const EnvironmentPixels* environment) {
  return guarded("gatherer", [&]() -> Result<Gatherer> {
    for (const Instance& instance : instances) {
      if (instance.scene.state_->engine == state_) continue;
      return Status::invalidArgument(
          fmt::format("{}: a scene of another engine", instance.scene.path()));
    }
    SURFEIT_ASSIGN_OR_RETURN(std::shared_ptr<const World> world,
                             World::create(state_, instances, settings, environment));
    return Gatherer::make(std::move(world));
  });
}

Status Engine::gatherAll(const std::vector<Instance>& instances, const GatherSettings& settings,
                         const Receiver* receivers, std::size_t count, GatherResult* results,
                         Progress& progress, int threads, const EnvironmentPixels* environment) {
  if (count == 0) return {};
  SURFEIT_ASSIGN_OR_RETURN(Gatherer first, gatherer(instances, settings, environment));
  StructArrays arrays(receivers, count, results);
  return first.gatherAll(arrays, progress, threads);
}

EngineStatistics Engine::statistics() const {
  EngineStatistics statistics;
  statistics.receivers = state_->monitor.receivers();
  statistics.memory_bytes = state_->options.memory_bytes;
  statistics.scenes = state_->scene_count;
  {
    const std::lock_guard lock(state_->mutex);
    statistics.held_bytes = state_->held_bytes;
    statistics.gatherers = static_cast<std::uint32_t>(state_->gatherer_count);
  }
  statistics.node_cache = state_->monitor.nodeStats();
  statistics.surfel_cache = state_->monitor.surfelStats();
  return statistics;
}

std::vector<GatherWindow> Engine::windows() const { return state_->monitor.windows(true); }

const SceneInfo& Scene::info() const { return state_->info; }
const std::string& Scene::path() const { return state_->octree->file().path(); }

}  // namespace surfeit
