// A scene that stays open from one gather to the next, for sequences of frames in front of a scene
// that does not change. What one gather has read into the caches the next one finds there.
#pragma once

#include <memory>
#include <string>

#include "surfeit/api.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// Holds at most one scene: its file, its page directory and both caches, within the budget of the
// gather that filled them. Empty at first. One thread at a time.
class SURFEIT_API KeptScene {
 public:
  KeptScene();
  KeptScene(KeptScene&&) noexcept;
  KeptScene& operator=(KeptScene&&) noexcept;
  ~KeptScene();

  // Closes the scene and gives its memory back.
  void close();
  // Whether a scene is held.
  bool isOpen() const;

  struct State;
  State& state() { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

// gatherCloud (surfeit/bake.h) in a scene that is kept: opens it where `kept` holds another one, or
// another state of this file (by device, inode, size and times), and leaves it there afterwards.
// Where the budget of this gather divides otherwise, and after a failure, the caches are emptied.
// The result has the same bytes. While receivers are sorted and results are written, the pages that
// are kept take no more than the caches of this gather do, less 8 MiB for readers and writers, and
// sorting does not borrow their memory. Statistics are of this gather alone, but for peak bytes and
// working sets. Errors: as gatherCloud.
SURFEIT_API Result<GatherStats> gatherCloud(const std::string& scene_path,
                                            const std::string& receivers_path,
                                            const std::string& result_path,
                                            const GatherOptions& options, Progress& progress,
                                            KeptScene& kept);

}  // namespace surfeit
