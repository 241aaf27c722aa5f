// The engine: scenes that stay open, and gathers at receivers in memory. Renderers, plug-ins and
// viewers call it; the jobs on files (surfeit/bake.h) stand on it.
//
//   Engine engine = *Engine::create({.memory_bytes = 512 << 20, .threads = 16});
//   Scene scene = *engine.open("set.sft");
//   Gatherer gatherer = *engine.gatherer(scene, settings);      // one per thread
//   Status status = gatherer.gather(receivers, count, results);  // thousands of times
//
// Compiles as C++17. No function throws: failures are values (surfeit/status.h), those of memory
// too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/scene.h"
#include "surfeit/statistics.h"
#include "surfeit/status.h"

namespace surfeit {

class SceneFile;
class World;
struct EngineState;
struct SceneState;

struct EngineOptions {
  // Budget of the engine: pages of all scenes, their directories, and what gatherers hold. Code,
  // libraries and what the caller holds are not counted. 0: three quarters of what the job may use.
  std::uint64_t memory_bytes = 0;
  // Gatherers that are expected to exist at a time, one per thread; more are possible, and find
  // less room in front of the caches. 0: as many as processors that the job may use.
  int threads = 0;
  bool direct_io = false;  // read scenes past the page cache of the system
};

// What an engine did since it was made. Counts of a moment: of calls that run they may be a few
// look-ups old.
struct EngineStatistics {
  std::uint64_t receivers = 0;                // gathered by all gatherers
  std::uint64_t memory_bytes = 0;             // the budget
  std::uint64_t held_bytes = 0;               // of it: directories, tables and gatherers
  std::uint32_t scenes = 0, gatherers = 0;    // that are open, that exist
  GatherCacheStats node_cache, surfel_cache;  // working sets are those of the last seconds
};

// A similarity: turned, scaled alike along all axes, and moved. Rows of a 3x4 matrix:
// x' = m[0] x + m[1] y + m[2] z + m[3], and so on. It turns by a proper rotation (no mirror) times
// a scale over 0, to a relative 1e-4.
struct Transform {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

// An open scene: immutable, shared, cheap to copy; any thread may copy and ask. It stays open as
// long as some copy, or a gatherer made from it, exists.
class SURFEIT_API Scene {
 public:
  // What readSceneInfo tells, without reading again.
  const SceneInfo& info() const;
  const std::string& path() const;

 private:
  friend class Engine;
  friend struct EngineAccess;
  explicit Scene(std::shared_ptr<SceneState> state) : state_(std::move(state)) {}
  std::shared_ptr<SceneState> state_;
};

// A scene as it stands in a world with others: a set that was indexed once, a character of the
// frame, one tree of a forest.
struct Instance {
  Scene scene;
  Transform transform{};
};

// A picture of light from all around, in memory (memo 7.3): lat-long, twice as wide as high, the
// top row up, as docs/algorithm.md, "Environment", has it. Radiances, finite and not negative.
struct EnvironmentPixels : EnvironmentPlacement {
  int width = 0, height = 0;
  const glm::vec3* pixels = nullptr;  // width * height, copied
};

// One thread's way of gathering. Calls on one gatherer must not overlap; different gatherers are
// free of each other. It holds its scenes and its engine, whatever becomes of their handles.
class SURFEIT_API Gatherer {
 public:
  Gatherer(Gatherer&&) noexcept;
  Gatherer& operator=(Gatherer&&) noexcept;
  ~Gatherer();

  // Gathers at `count` receivers. After its first calls it allocates nothing, unless a cut grows
  // larger than any before; where the caches are smaller than the scenes, the engine looks four
  // times a second how they should share their memory, which takes some allocations. Neighbours
  // share work, so hand over neighbours, in the order of a curve or of the picture: up to 256
  // consecutive ones share one walk. Their results differ by less than .004 from those of other
  // companions. A receiver that is not finite, or with kGlossy lacks a normal or a view, gets NaN.
  // `progress`, where given, is asked now and then whether to stop. Errors: kIoError and
  // kCorruption of a page, kInterrupted; results are then incomplete, and the gatherer may be used
  // again. kInvalidArgument while another call of this gatherer is on its way.
  Status gather(const Receiver* receivers, std::size_t count, GatherResult* results,
                const Progress* progress = nullptr);

  // A gatherer of the same world for another thread: what they can share, they do. Errors:
  // kBudgetTooSmall with the budget that would do.
  Result<Gatherer> another() const;

  // Lets go of the pages that it holds in front of the caches. For threads that do something else
  // for long: others may wait for these pages' memory.
  void pause();

  // Receivers of all calls so far, and of these the ones without a result.
  std::uint64_t receivers() const;
  std::uint64_t invalidReceivers() const;

 private:
  friend class Engine;
  struct State;
  explicit Gatherer(std::unique_ptr<State> state);
  static Result<Gatherer> make(std::shared_ptr<const World> world);
  std::unique_ptr<State> state_;
};

// One memory budget and two caches for any number of scenes. A handle: copies are of one engine,
// which lives as long as any of them, its scenes and gatherers. Safe from any thread. An engine has
// no threads of its own, but while gatherAll runs.
class SURFEIT_API Engine {
 public:
  // Errors: kInvalidArgument, kBudgetTooSmall, kFailed when address space cannot be had.
  static Result<Engine> create(const EngineOptions& options);

  // Opens a paged octree file (surfeit/index.h makes them). Reads header and directory, no page.
  // Files may be opened many times: each is a scene of its own, with its own pages in the caches.
  // Errors: kIoError, kCorruption, kBudgetTooSmall with the budget that would do.
  Result<Scene> open(const std::string& path);
  // The same of a file's bytes, which are copied and count as part of the budget. `name` begins
  // messages about it.
  Result<Scene> openBytes(const void* bytes, std::size_t size, const std::string& name);

  // A gatherer of one scene in its own coordinates, or of several that see each other in one world.
  // Its environment is copied; null: none. Instances are grouped in a tree of their own: what is
  // far is seen as one, however many it is. To make one reads the upper pages of every scene and a
  // sample of its surfels.
  // Errors: kInvalidArgument (settings, transforms, no instance, groups that no scene has),
  // kBudgetTooSmall with the budget that would do, kIoError, kCorruption.
  Result<Gatherer> gatherer(const Scene& scene, const GatherSettings& settings,
                            const EnvironmentPixels* environment = nullptr);
  Result<Gatherer> gatherer(const std::vector<Instance>& instances, const GatherSettings& settings,
                            const EnvironmentPixels* environment = nullptr);

  // Gathers at all receivers, in an order of its own along the curve of the world, on `threads`
  // threads (0: EngineOptions::threads) with a gatherer each. Holds 12 bytes per receiver
  // meanwhile, beside the budget. At most 4 billion receivers. The
  // result depends on instances, settings and receivers alone.
  // Errors: as gatherer and gather.
  Status gatherAll(const std::vector<Instance>& instances, const GatherSettings& settings,
                   const Receiver* receivers, std::size_t count, GatherResult* results,
                   Progress& progress, int threads = 0,
                   const EnvironmentPixels* environment = nullptr);

  EngineStatistics statistics() const;
  // What the caches did over time, in order; at most some hundreds, however long it took. The last
  // one ends now.
  std::vector<GatherWindow> windows() const;

 private:
  explicit Engine(std::shared_ptr<EngineState> state) : state_(std::move(state)) {}
  Result<Scene> add(SceneFile file, std::uint64_t more_bytes = 0);
  std::shared_ptr<EngineState> state_;
};

}  // namespace surfeit
