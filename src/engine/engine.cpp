#include "surfeit/engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <utility>

#include "core/bounds.h"
#include "core/curve_key.h"
#include "core/first_failure.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/parallel.h"
#include "core/worker_threads.h"
#include "engine/gatherer_state.h"
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

OctreeCaches::Options cacheOptions(std::uint64_t bytes) {
  return {.node_page_bytes = kDefaultNodeGroup * sizeof(Node),
          .surfel_page_bytes = kDefaultSurfelGroup * sizeof(Surfel),
          .node_pages = kNodePages,
          .surfel_pages = kSurfelPages,
          .node_frames = 1,
          .surfel_frames = 1,
          .most_bytes = bytes,
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

// Receivers in an order in which neighbours follow each other.
std::vector<std::uint32_t> curveOrder(const Receiver* receivers, std::size_t count) {
  Bounds3d bounds;
  const auto isFinite = [](const glm::dvec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  for (std::size_t i = 0; i < count; ++i) {
    if (isFinite(receivers[i].position)) bounds.add(receivers[i].position);
  }
  const glm::dvec3 middle = bounds.centre();
  const glm::dvec3 half = 0.5 * bounds.extent();
  const RootCube cube = rootCube(Bounds3d{-half, half});
  std::vector<CurveKey> keys(count, ~CurveKey{0});
  for (std::size_t i = 0; i < count; ++i) {
    if (isFinite(receivers[i].position)) {
      keys[i] = curveKey(glm::vec3(receivers[i].position - middle), cube);
    }
  }
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
  });
  return order;
}

// Hands out whole groups of receivers in order.
class GroupedReceivers {
 public:
  GroupedReceivers(const Receiver* receivers, std::size_t count, GatherResult* results)
      : receivers_(receivers), results_(results), order_(curveOrder(receivers, count)) {}

  // Gathers until none is left, or something has failed.
  Status gatherAll(Gatherer& gatherer, const FirstFailure& failure, Progress& progress) {
    constexpr std::size_t kRun = kGroupReceivers;
    std::vector<Receiver> run;
    std::vector<GatherResult> found(kRun);
    while (!failure.happened()) {
      const std::size_t begin = next_.fetch_add(kRun);
      if (begin >= order_.size()) return {};
      const std::size_t end = std::min(order_.size(), begin + kRun);
      run.clear();
      for (std::size_t i = begin; i < end; ++i) run.push_back(receivers_[order_[i]]);
      SURFEIT_RETURN_IF_ERROR(gatherer.gather(run.data(), run.size(), found.data(), &progress));
      for (std::size_t i = begin; i < end; ++i) results_[order_[i]] = found[i - begin];
      progress.advance(end - begin);
    }
    return {};
  }

 private:
  const Receiver* const receivers_;
  GatherResult* const results_;
  const std::vector<std::uint32_t> order_;
  std::atomic<std::size_t> next_{0};
};

}  // namespace

Result<Engine> Engine::create(const EngineOptions& given) {
  return guarded("engine", [&]() -> Result<Engine> {
    EngineOptions options = given;
    if (options.threads < 0 || options.threads > kMostThreads) {
      return Status::invalidArgument(
          fmt::format("thread count is {}, expected 0 to {}", options.threads, kMostThreads));
    }
    if (options.threads == 0) options.threads = defaultThreadCount();
    if (options.memory_bytes == 0) options.memory_bytes = defaultMemoryBytes();
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<OctreeCaches> caches,
                             OctreeCaches::create(cacheOptions(options.memory_bytes)));
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
  return guarded("gather", [&]() -> Status {
    const std::size_t runs = (count + kGroupReceivers - 1) / kGroupReceivers;
    const std::size_t wanted =
        std::min(runs, static_cast<std::size_t>(threads > 0 ? threads : state_->options.threads));
    if (count == 0) return {};
    if (count > std::numeric_limits<std::uint32_t>::max()) {
      return Status::invalidArgument(
          fmt::format("{} receivers at once, expected less than 2^32: call it for parts", count));
    }
    std::vector<Gatherer> gatherers;
    SURFEIT_ASSIGN_OR_RETURN(Gatherer first, gatherer(instances, settings, environment));
    gatherers.push_back(std::move(first));
    while (gatherers.size() < wanted) {
      Result<Gatherer> more = gatherers.front().another();
      if (!more.ok()) break;  // fewer do the same in a longer time
      gatherers.push_back(std::move(*more));
    }
    progress.beginPhase("gather", count, "receivers");
    GroupedReceivers groups(receivers, count, results);
    std::atomic<std::size_t> taken{0};
    FirstFailure failure;
    return runOnThreads(int(gatherers.size()), failure, "gather", [&] {
      Gatherer& own = gatherers[taken.fetch_add(1)];
      const Status status = groups.gatherAll(own, failure, progress);
      own.pause();
      return status;
    });
  });
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
