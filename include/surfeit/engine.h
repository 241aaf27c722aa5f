// The engine keeps scenes open and gathers at receivers in memory. Renderers, plug-ins and viewers
// call it; the jobs on files (surfeit/bake.h) use it.
//
//   Engine engine = *Engine::create({.memory_bytes = 512 << 20, .threads = 16});
//   Scene scene = *engine.open("set.sft");
//   Gatherer gatherer = *engine.gatherer(scene, settings);      // one per thread
//   Status status = gatherer.gather(receivers, count, results);  // thousands of times
//
// Compiles as C++17. No function throws: failures are values (surfeit/status.h), and so is a lack
// of memory.
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
  // Budget of the engine: pages of all scenes, their directories, and the memory of gatherers.
  // Code, libraries and the caller's own memory are not counted. 0: three quarters of the memory
  // that the job may use.
  std::uint64_t memory_bytes = 0;
  // Expected number of gatherers at a time, one per thread. More are possible, with less room in
  // front of the caches. 0: one per processor that the job may use.
  int threads = 0;
  bool direct_io = false;  // read scenes past the page cache of the system
  // Room for the lobes of scenes of BounceOptions::glossy, which are refused without it. A node
  // takes 18 % more of the budget then, a surfel 16 %, in all scenes.
  bool lobes = false;
};

// Counts since the engine was created. During calls they may be a few look-ups old.
struct EngineStatistics {
  std::uint64_t receivers = 0;                // gathered by all gatherers
  std::uint64_t memory_bytes = 0;             // the budget
  std::uint64_t held_bytes = 0;               // of the budget: directories, tables and gatherers
  std::uint32_t scenes = 0, gatherers = 0;    // open scenes, existing gatherers
  GatherCacheStats node_cache, surfel_cache;  // working sets are of the last seconds
};

// A similarity: rotation, uniform scale and translation. Rows of a 3x4 matrix:
// x' = m[0] x + m[1] y + m[2] z + m[3], and so on. The left 3x3 part must be a proper rotation (no
// mirror) times a scale above 0, to a relative 1e-4.
struct Transform {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

// A handle of an open scene: immutable, shared, cheap to copy. Safe from any thread. The scene
// stays open as long as a copy of the handle, or a gatherer of the scene, exists.
class SURFEIT_API Scene {
 public:
  // The same as readSceneInfo (surfeit/scene.h), without reading the file again.
  const SceneInfo& info() const;
  const std::string& path() const;

 private:
  friend class Engine;
  friend struct EngineAccess;
  explicit Scene(std::shared_ptr<SceneState> state) : state_(std::move(state)) {}
  std::shared_ptr<SceneState> state_;
};

// A scene with its place in a world of several: a set, a character of the frame, one tree of a
// forest.
struct Instance {
  Scene scene;
  Transform transform{};
};

// An environment picture in memory, light from infinitely far away (memo 7.3): lat-long, twice as
// wide as high, the top row up (docs/algorithm.md, "Environment light"). Radiances, finite and not
// negative.
struct EnvironmentPixels : EnvironmentPlacement {
  int width = 0, height = 0;
  const glm::vec3* pixels = nullptr;  // width * height, copied
};

// Receivers and results where the caller has them: columns, chunks, fields of own structs. The
// functions are called from several threads at once; results of different receivers are set at the
// same time. They must not throw.
class SURFEIT_API ReceiverArray {
 public:
  virtual ~ReceiverArray() = default;
  virtual std::size_t count() const = 0;
  // The receiver number `index`, below count(); each is asked for more than once, and must be the
  // same each time.
  virtual Receiver receiver(std::size_t index) const = 0;
  // Called once for each receiver, with NaN for a receiver that is not valid.
  virtual void setResult(std::size_t index, const GatherResult& result) = 0;
};

// Gathers for one thread at a time. Calls on one gatherer must not overlap; different gatherers are
// independent. A gatherer keeps its scenes and its engine alive, even after their handles are gone.
class SURFEIT_API Gatherer {
 public:
  Gatherer(Gatherer&&) noexcept;
  Gatherer& operator=(Gatherer&&) noexcept;
  ~Gatherer();

  // Gathers at `count` receivers. After its first calls a gatherer allocates nothing, unless a cut
  // grows larger than any before. Where the caches are smaller than the scenes, the engine divides
  // memory between them anew four times a second, which takes some allocations. Neighbours share
  // work, so pass neighbours together, in the order of a curve or of the picture. The gatherer
  // takes 256 consecutive receivers at a time and divides them into packets of up to 16, which
  // share a walk through the octree. A receiver's result differs by less than .004 with other
  // companions. With GatherQuality::max_variation above 0 it takes 4096 at a time, gathers some,
  // and interpolates the others among these. A receiver that is not finite, or with kGlossy lacks a
  // normal or a view, gets NaN. The call polls `progress`, where given, for a request to stop.
  // Errors: kIoError and kCorruption of a page, kInterrupted; results are then incomplete, and the
  // gatherer may be used again. kInvalidArgument while another call of this gatherer runs.
  Status gather(const Receiver* receivers, std::size_t count, GatherResult* results,
                const Progress* progress = nullptr);

  // Gathers at all receivers along a Hilbert curve: the scene's, if the world is one scene in its
  // own coordinates, else a curve within the bounds of the receivers. Works on `threads` threads
  // (0: EngineOptions::threads), this one among them, with this gatherer and others made for the
  // call, as far as the budget has room for them. Takes 12 bytes per receiver of the budget while
  // it sorts, and 4 until it ends. At most 4 billion receivers. Results depend only on world,
  // settings and receivers. For one scene in its own coordinates, and with a max_variation of 0,
  // they have the bits of gatherCloud (surfeit/bake.h). Errors: as gather, and kBudgetTooSmall with
  // the least budget that works.
  Status gatherAll(ReceiverArray& receivers, Progress& progress, int threads = 1);

  // A gatherer of the same world for another thread; the two share data where they can. Errors:
  // kBudgetTooSmall with the least budget that works.
  Result<Gatherer> another() const;

  // Releases the pages that the gatherer holds in front of the caches. Call it in threads that do
  // something else for long, because others may wait for the memory of these pages.
  void pause();

  // Receivers of all calls so far, and the receivers among them without a result.
  std::uint64_t receivers() const;
  std::uint64_t invalidReceivers() const;

 private:
  friend class Engine;
  struct State;
  explicit Gatherer(std::unique_ptr<State> state);
  static Result<Gatherer> make(std::shared_ptr<const World> world);
  std::unique_ptr<State> state_;
};

// One memory budget and two caches for any number of scenes. A handle: copies refer to one engine,
// which lives as long as any copy, scene or gatherer of it. Safe from any thread. An engine has no
// threads of its own, except while gatherAll runs.
class SURFEIT_API Engine {
 public:
  // Errors: kInvalidArgument, kBudgetTooSmall, kFailed when address space cannot be had.
  static Result<Engine> create(const EngineOptions& options);

  // Opens a paged octree file (surfeit/index.h builds them). Reads header and directory, no page. A
  // file may be opened many times: each time gives another scene, with its own pages in the caches.
  // Errors: kIoError, kCorruption, kBudgetTooSmall with the least budget that works.
  Result<Scene> open(const std::string& path);
  // Opens the bytes of a file. They are copied and count as part of the budget. Messages about the
  // scene begin with `name`.
  Result<Scene> openBytes(const void* bytes, std::size_t size, const std::string& name);

  // A gatherer of one scene in its own coordinates, or of several instances that see each other in
  // one world. The environment is copied; null: none. A tree over the instances lets the gather see
  // many far instances as one node. Creation reads the upper pages of every scene and a sample of
  // its surfels.
  // Errors: kInvalidArgument (settings, transforms, no instance, object groups that no scene has),
  // kBudgetTooSmall with the least budget that works, kIoError, kCorruption.
  Result<Gatherer> gatherer(const Scene& scene, const GatherSettings& settings,
                            const EnvironmentPixels* environment = nullptr);
  Result<Gatherer> gatherer(const std::vector<Instance>& instances, const GatherSettings& settings,
                            const EnvironmentPixels* environment = nullptr);

  // Makes a gatherer and calls its gatherAll with arrays of structs, on `threads` threads (0:
  // EngineOptions::threads). Errors: as gatherer and gather.
  Status gatherAll(const std::vector<Instance>& instances, const GatherSettings& settings,
                   const Receiver* receivers, std::size_t count, GatherResult* results,
                   Progress& progress, int threads = 0,
                   const EnvironmentPixels* environment = nullptr);

  EngineStatistics statistics() const;
  // Cache statistics over time, in order; at most some hundreds, for any running time. The last
  // window ends now.
  std::vector<GatherWindow> windows() const;

 private:
  explicit Engine(std::shared_ptr<EngineState> state) : state_(std::move(state)) {}
  Result<Scene> add(SceneFile file, std::uint64_t more_bytes = 0);
  std::shared_ptr<EngineState> state_;
};

}  // namespace surfeit
