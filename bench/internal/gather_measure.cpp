#include "bench/internal/gather_measure.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <latch>
#include <mutex>
#include <thread>
#include <utility>

#include "gather/packet/packet_gatherer.h"

namespace surfeit {
namespace {

// So many receivers at a time: clusters of packets, or each alone.
class PacketEngine : public GatherEngine {
 public:
  PacketEngine(GatherMode mode, const GatherQuality& quality, std::size_t together)
      : gatherer_(mode, quality), together_(together) {}

  Status gather(std::span<const LocalReceiver> receivers, PagedOctree::Reader& octree,
                std::span<GatherResult> results) override {
    for (std::size_t i = 0; i < receivers.size(); i += together_) {
      const std::size_t count = std::min(together_, receivers.size() - i);
      SURFEIT_RETURN_IF_ERROR(
          gatherer_.gather(receivers.subspan(i, count), octree, results.subspan(i, count)));
    }
    receivers_ += receivers.size();
    return {};
  }
  EngineWork work() const override {
    const PacketGatherer::Work& work = gatherer_.work();
    return {.receivers = receivers_,
            .nodes_visited = work.nodes_visited,
            .surfels_visited = work.surfels_visited,
            .contributions = work.patches};
  }

 private:
  PacketGatherer gatherer_;
  const std::size_t together_;
  std::uint64_t receivers_ = 0;
};

struct EngineKind {
  const char* name;
  std::size_t together;
};
constexpr EngineKind kEngines[] = {{"alone", 1}, {"packet", kClusterReceivers}};

double meanOf(const glm::vec3& rgb) { return (double(rgb.x) + double(rgb.y) + double(rgb.z)) / 3; }

}  // namespace

const std::vector<std::string>& engineNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> found;
    for (const EngineKind& kind : kEngines) found.emplace_back(kind.name);
    return found;
  }();
  return names;
}

Result<std::unique_ptr<GatherEngine>> makeEngine(const std::string& name, GatherMode mode,
                                                 const GatherQuality& quality) {
  for (const EngineKind& kind : kEngines) {
    if (name == kind.name) {
      return std::unique_ptr<GatherEngine>(
          std::make_unique<PacketEngine>(mode, quality, kind.together));
    }
  }
  return Status::invalidArgument(
      fmt::format("engine {}: expected one of {}", name, fmt::join(engineNames(), ", ")));
}

std::size_t engineBlock(const std::string& name) {
  for (const EngineKind& kind : kEngines) {
    if (name == kind.name) return kind.together;
  }
  return 1;
}

Result<Timing> timeGather(const ReceiverSet& set, std::size_t per_run,
                          std::span<const std::unique_ptr<Worker>> workers) {
  using Clock = std::chrono::steady_clock;
  Timing timing;
  std::atomic<std::size_t> next_run = 0;
  std::latch ready(std::ptrdiff_t(workers.size()));  // threads may start late
  Clock::time_point first_begin = Clock::time_point::max(), last_end = Clock::time_point::min();
  Status status;
  std::mutex mutex;  // guards timing, the two times and status
  const auto work = [&](Worker& worker) {
    std::vector<GatherResult> results(per_run);
    std::size_t receivers = 0;
    Status failure;
    ready.arrive_and_wait();
    const Clock::time_point clock_begin = Clock::now();
    const double cpu_begin = threadCpuSeconds();
    for (std::size_t run = next_run++; run < set.runCount() && failure.ok(); run = next_run++) {
      const std::size_t begin = run * set.run_length;
      const std::size_t run_end = std::min(begin + set.run_length, set.receivers.size());
      const std::size_t end = std::min(begin + per_run, run_end);
      failure = worker.gather(set, begin, end, std::span(results).first(end - begin));
      receivers += end - begin;
    }
    worker.pause();
    const double cpu_seconds = threadCpuSeconds() - cpu_begin;
    const std::lock_guard lock(mutex);
    first_begin = std::min(first_begin, clock_begin);
    last_end = std::max(last_end, Clock::now());
    timing.receivers += receivers;
    timing.cpu_seconds += cpu_seconds;
    if (!failure.ok()) status = failure;
  };
  std::vector<std::jthread> threads;
  for (const auto& worker : workers) threads.emplace_back([&] { work(*worker); });
  threads.clear();
  timing.wall_seconds = std::chrono::duration<double>(last_end - first_begin).count();
  SURFEIT_RETURN_IF_ERROR(status);
  return timing;
}

Result<std::vector<GatherResult>> gatherJudged(const ReceiverSet& set, std::size_t block,
                                               Worker& worker) {
  std::vector<GatherResult> judged, results(block);
  std::size_t begin = 0, end = 0;  // of the receivers that `results` has
  for (const std::uint32_t receiver : set.judged) {
    if (receiver >= end) {
      // Blocks begin anew with each run
      const std::size_t run = receiver / set.run_length * set.run_length;
      const std::size_t run_end = std::min(run + set.run_length, set.receivers.size());
      begin = run + (receiver - run) / block * block;
      end = std::min(begin + block, run_end);
      SURFEIT_RETURN_IF_ERROR(
          worker.gather(set, begin, end, std::span(results).first(end - begin)));
    }
    judged.push_back(results[receiver - begin]);
  }
  return judged;
}

ErrorSummary summarise(std::span<const GatherResult> results, std::span<const GatherResult> truth) {
  const auto figuresOf = [&](auto valueOf) {
    return summariseErrors(
        results.size(), [&](std::size_t i) { return valueOf(results[i]) - valueOf(truth[i]); },
        [&](std::size_t i) { return valueOf(truth[i]); });
  };
  ErrorSummary summary{
      figuresOf([](const GatherResult& result) { return double(result.occlusion); })};
  const ErrorFigures color =
      figuresOf([](const GatherResult& result) { return meanOf(result.irradiance); });
  summary.color_bias = color.bias / color.mean;
  summary.color_rmse = color.rmse / color.mean;
  return summary;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double threadCpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

}  // namespace surfeit
