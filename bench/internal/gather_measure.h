// How the gather benches measure: ways to gather, their rates in processor time, and their errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench/internal/error_summary.h"
#include "bench/internal/gather_scenes.h"
#include "gather/rules/receiver.h"
#include "octree/read/paged_octree.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// What gathers took, summed. Receivers that are gathered together share what they visit and draw.
struct EngineWork {
  std::uint64_t receivers = 0;
  std::uint64_t nodes_visited = 0, surfels_visited = 0;
  std::uint64_t contributions = 0;  // nodes and surfels drawn
};

// A way to gather from the octree. One thread at a time.
class GatherEngine {
 public:
  virtual ~GatherEngine() = default;
  // Gathers at receivers that are neighbours along the curve. results.size() is receivers.size().
  virtual Status gather(std::span<const LocalReceiver> receivers, PagedOctree::Reader& octree,
                        std::span<GatherResult> results) = 0;
  // Of all gathers so far.
  virtual EngineWork work() const = 0;
};

// Names of all engines, and one of them. kInvalidArgument for another name.
const std::vector<std::string>& engineNames();
Result<std::unique_ptr<GatherEngine>> makeEngine(const std::string& name, GatherMode mode,
                                                 const GatherQuality& quality);
// Receivers whose results do not depend on others: the engine gathers the same when given runs cut
// at multiples of this.
std::size_t engineBlock(const std::string& name);

// Gathers at receivers of a set, by whatever means. One thread at a time.
class Worker {
 public:
  virtual ~Worker() = default;
  // Receivers [begin, end) of `set`; results.size() is end - begin.
  virtual Status gather(const ReceiverSet& set, std::size_t begin, std::size_t end,
                        std::span<GatherResult> results) = 0;
  // Lets go of what others may wait for.
  virtual void pause() {}
};

// An engine and its way into the octree.
class EngineWorker : public Worker {
 public:
  EngineWorker(std::unique_ptr<GatherEngine> engine, PagedOctree& octree)
      : engine_(std::move(engine)), reader_(octree) {}
  Status gather(const ReceiverSet& set, std::size_t begin, std::size_t end,
                std::span<GatherResult> results) override {
    return engine_->gather(std::span(set.receivers).subspan(begin, end - begin), reader_, results);
  }
  void pause() override { reader_.release(); }
  GatherEngine& engine() { return *engine_; }

 private:
  std::unique_ptr<GatherEngine> engine_;
  PagedOctree::Reader reader_;
};

// Time that receivers took.
struct Timing {
  std::size_t receivers = 0;
  double cpu_seconds = 0;  // of all threads
  double wall_seconds = 0;

  // Receivers per second of one thread's processor time.
  double rate() const { return double(receivers) / cpu_seconds; }
  // Receivers per second of all threads, as long as it took.
  double wallRate() const { return double(receivers) / wall_seconds; }
};

// Gathers at the first `per_run` receivers of each run, on a thread for each of `workers`.
Result<Timing> timeGather(const ReceiverSet& set, std::size_t per_run,
                          std::span<const std::unique_ptr<Worker>> workers);

// Gathers at the judged receivers, and at those that share a block with them, as one thread.
// Returns the results of the judged ones.
Result<std::vector<GatherResult>> gatherJudged(const ReceiverSet& set, std::size_t block,
                                               Worker& worker);

// Results against the truth, over all judged receivers. The figures are those of occlusion.
struct ErrorSummary : ErrorFigures {
  double color_rmse = 0, color_bias = 0;  // of the mean of rgb, over the mean of the truth
};
ErrorSummary summarise(std::span<const GatherResult> results, std::span<const GatherResult> truth);

double median(std::vector<double> values);

// Processor time of the calling thread, in seconds.
double threadCpuSeconds();

}  // namespace surfeit
