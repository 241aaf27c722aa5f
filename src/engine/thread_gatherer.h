// How one thread gathers in a world, for the engine and for jobs alike: its way into the caches,
// and what it computes with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/world.h"
#include "gather/packet/group_gatherer.h"
#include "gather/packet/world_walk.h"
#include "octree/read/paged_octree.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Keeps the world.
class ThreadGatherer {
 public:
  explicit ThreadGatherer(std::shared_ptr<const World> world);
  ThreadGatherer(const ThreadGatherer&) = delete;
  ThreadGatherer& operator=(const ThreadGatherer&) = delete;

  const World& world() const { return *world_; }
  const std::shared_ptr<const World>& sharedWorld() const { return world_; }

  // Receivers that are gathered together at most.
  std::size_t size() const { return gatherer_.size(); }
  // Gathers at 1 to size() receivers, counted from the world's origin. Errors: as
  // GroupGatherer::gather.
  Status gather(std::span<const LocalReceiver> receivers, std::span<GatherResult> results) {
    return gatherer_.gather(receivers, view_, results);
  }
  // Receivers interpolated by all gathers so far.
  std::uint64_t interpolatedCount() const { return gatherer_.interpolatedCount(); }

  // Into the octree of a world of one scene, for whoever looks at its surfels beside.
  PagedOctree::Reader& reader() { return reader_; }

 private:
  const std::shared_ptr<const World> world_;
  PagedOctree::Reader reader_;
  WorldReader view_;
  GroupGatherer gatherer_;
};

}  // namespace surfeit
