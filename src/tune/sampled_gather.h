// Gathers at some receivers to see how long that takes. Results are thrown away.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "batch/paging_controller.h"
#include "batch/sorted_receiver.h"
#include "engine/world.h"
#include "octree/read/paged_octree.h"
#include "surfeit/bake.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "tune/quiet_progress.h"

namespace surfeit {

// One thread at a time; each call works with `threads` of its own.
class SampledGather {
 public:
  // Opens the caches of `scene`, which neither share their memory anew nor prefetch, so that
  // look-ups are those of the receivers alone. `progress` advances by receivers, and must outlive
  // this.
  static Result<std::unique_ptr<SampledGather>> create(SceneFile scene,
                                                       const PagedOctree::Memory& memory,
                                                       const GatherOptions& options, int threads,
                                                       Progress& progress);

  // Gathers at these receivers; returns the wall time until all are done.
  Result<double> gather(std::span<const SortedReceiver> receivers);

  OctreeCaches& caches() { return *world_->engine().caches; }

 private:
  SampledGather(std::shared_ptr<const World> world, int threads, Progress& progress);

  const std::shared_ptr<const World> world_;
  const int threads_;
  QuietProgress progress_;
  PagingController controller_;
};

}  // namespace surfeit
