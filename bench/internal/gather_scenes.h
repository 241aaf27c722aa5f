// The scenes of the gather benches: an octree, the geometry that it stands for, and receivers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench/internal/gather_scene_geometry.h"
#include "gather/rules/receiver.h"
#include "octree/read/paged_octree.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Where scenes come from and go.
struct SceneOptions {
  std::string data = "../shared/data";  // of the scenes made from files
  std::string keep;                     // directory for scene files and references; empty: none
  std::uint64_t surfels = 0;            // 0: the scene's own default
  int threads = 0;                      // to build with; 0: all that the job may use
};

// Names of the scenes that errors are reported for, and of others that no number of the gather was
// chosen by.
const std::vector<std::string>& gatherSceneNames();
const std::vector<std::string>& unseenSceneNames();
// The file that a scene lacks, empty when it can be made.
std::string missingSceneFile(const std::string& name, const SceneOptions& options);

// A directory for the files of a run: the one given, made when it is not there, or one of its own
// that goes with it.
class WorkDirectory {
 public:
  static Result<WorkDirectory> open(const std::string& keep);
  WorkDirectory(WorkDirectory&& other) noexcept;
  ~WorkDirectory();
  const std::string& path() const { return path_; }
  bool isKept() const { return is_kept_; }

 private:
  WorkDirectory(std::string path, bool is_kept) : path_(std::move(path)), is_kept_(is_kept) {}
  std::string path_;
  bool is_kept_ = true;
};

// Immutable once open.
class GatherScene {
 public:
  // Makes the scene, unless the directory to keep has it from an earlier run. kIoError when files
  // of the scene are missing, kInvalidArgument for an unknown name.
  static Result<GatherScene> open(const std::string& name, const SceneOptions& options,
                                  Progress& progress);

  const std::string& name() const { return name_; }
  const SceneGeometry& geometry() const { return geometry_; }
  const std::string& octreePath() const { return octree_path_; }
  const WorkDirectory& directory() const { return directory_; }
  // The octree with everything in memory, or in `cache_bytes` of it.
  Result<std::unique_ptr<PagedOctree>> openOctree(int threads, std::size_t cache_bytes = 0) const;

 private:
  GatherScene(std::string name, WorkDirectory directory)
      : name_(std::move(name)), directory_(std::move(directory)) {}
  Status makeOctree(std::uint64_t count, int threads, Progress& progress) const;

  std::string name_;
  WorkDirectory directory_;
  SceneGeometry geometry_;
  std::string octree_path_;
};

// Receivers on surfels of a scene, along its curve, in runs of neighbours.
struct ReceiverSet {
  std::string name;
  std::vector<LocalReceiver> receivers{};
  std::vector<float> radii{};           // of their surfels
  std::size_t run_length = 0;           // the last run may be shorter
  std::vector<std::uint32_t> judged{};  // those whose errors are measured, ascending

  std::size_t runCount() const { return (receivers.size() + run_length - 1) / run_length; }
};

// 64 runs of 1,024 surfels that follow each other along the curve, spread over the scene; every
// 32nd is judged. Fewer where the scene is small.
Result<ReceiverSet> denseReceivers(const SceneFile& file);
// 50,000 surfels at equal distances along the curve; about as many are judged.
Result<ReceiverSet> scatteredReceivers(const SceneFile& file);
// `count` surfels that follow each other along the curve, from `first_part` of it on (0..1), in
// runs of 1,024; none is judged. Fewer at the end of the scene.
Result<ReceiverSet> consecutiveReceivers(const SceneFile& file, double first_part,
                                         std::size_t count);
// The one of the first two: "dense" or "scattered".
Result<ReceiverSet> chooseReceivers(const std::string& name, const SceneFile& file);
// All surfels of the scene, along the curve.
Result<std::vector<Surfel>> allSurfels(const SceneFile& file);

}  // namespace surfeit
