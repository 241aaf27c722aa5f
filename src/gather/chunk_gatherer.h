// Gathers at many receivers on a fixed number of threads. The receivers come ordered along the
// scene's curve; every thread takes the next run of neighbours, so that all of them work in one
// neighbourhood and what one reads the others find in the caches.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "core/curve_key.h"
#include "gather/gather_point.h"
#include "octree/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit {

// A receiver's place on the curve, and its index in its chunk.
struct OrderedReceiver {
  CurveKey key;
  std::uint32_t index;

  bool operator<(const OrderedReceiver& other) const {
    return key != other.key ? key < other.key : index < other.index;
  }
};

// One caller at a time; must go before octree and progress do. The threads' gatherers, their
// readers and the pages these hold stay from one chunk to the next.
class ChunkGatherer {
 public:
  ChunkGatherer(PagedOctree& octree, const GatherOptions& options, int threads, Progress& progress);
  ~ChunkGatherer();

  // Gathers at receivers[i] into results[i] for every index i in `order`, and advances the
  // progress. Returns the first failure, kInterrupted when the progress is cancelled; the results
  // are then incomplete, and this gatherer is of no further use.
  Status gather(std::span<const OrderedReceiver> order, std::span<const Receiver> receivers,
                std::span<GatherResult> results);

 private:
  // What one thread gathers with.
  struct Worker {
    Worker(const GatherOptions& options, PagedOctree& octree)
        : gatherer(options.mode, options.quality), reader(octree) {}

    PointGatherer gatherer;
    PagedOctree::Reader reader;
  };

  void work(Worker& worker);
  Status gatherRun(Worker& worker, std::span<const OrderedReceiver> run);
  void fail(Status status);

  Progress& progress_;
  std::vector<std::unique_ptr<Worker>> workers_;

  // The chunk at hand; written while no other thread runs
  std::span<const OrderedReceiver> order_;
  std::span<const Receiver> receivers_;
  std::span<GatherResult> results_;

  std::atomic<std::size_t> next_{0};  // place in order_ of the next run to take
  std::atomic<bool> has_failed_{false};
  std::mutex mutex_;
  Status failure_;  // guarded by mutex_
};

}  // namespace surfeit
