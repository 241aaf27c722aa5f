// Follows the look-ups of a gather without gathering: walks the cuts of sorted receivers in the
// order in which threads take them, and tells the pages to who wants to know.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "batch/sorted_receiver.h"
#include "cache/reuse_distances.h"
#include "gather/cut/cut.h"
#include "gather/cut/packet_cluster.h"
#include "gather/cut/packet_cost.h"
#include "octree/read/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// The look-ups of both caches. One thread at a time.
struct LookUps {
  // Watches up to `tracked_pages` pages of either kind.
  LookUps(const SceneFile& file, std::size_t tracked_pages)
      : node_distances(file.nodePageCount(), tracked_pages),
        surfel_distances(file.surfelPageCount(), tracked_pages) {}
  static std::uint64_t memoryBytes(const SceneFile& file, std::size_t tracked_pages) {
    return ReuseDistances::memoryBytes(file.nodePageCount(), tracked_pages) +
           ReuseDistances::memoryBytes(file.surfelPageCount(), tracked_pages);
  }

  ReuseDistances node_distances, surfel_distances;
  std::uint64_t node_requests = 0, surfel_requests = 0;
  std::uint64_t receivers = 0;
};

// Threads are taken in turn, a cluster each, so that what is found depends on the receivers and
// the number of threads alone. Surfel pages are counted and never read. One thread at a time.
class LookUpTrace {
 public:
  // Replaces the run by the next neighbours in the order; none at the end.
  using NextRun = std::function<Status(std::vector<SortedReceiver>& run)>;

  // All that is referred to must outlive the trace. `progress` advances by receivers.
  LookUpTrace(PagedOctree& octree, const GatherRules& rules, int threads, Progress& progress);

  // Adds to `every` the look-ups of all receivers that are to come, and to `second`, unless null,
  // those of every second cluster.
  Status follow(const NextRun& next, LookUps& every, LookUps* second = nullptr);
  // The same of a piece of the order.
  Status follow(std::span<const SortedReceiver> receivers, LookUps& every,
                LookUps* second = nullptr);

 private:
  // What CutWalk walks; one of the threads that are imitated.
  class Reader;
  Status walk(std::span<const LocalReceiver> receivers, Reader& reader);

  const GatherRules rules_;
  const std::size_t threads_;
  Progress& progress_;
  const std::uint32_t surfel_group_capacity_;
  PagedOctree::Reader octree_;
  const std::unique_ptr<CutWalk> cut_;
  PacketCost cost_;
};

}  // namespace surfeit
