#include "gather/chunk_gatherer.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <system_error>
#include <thread>
#include <utility>

namespace surfeit {
namespace {

// Enough receivers to stay in one place for a while, and few enough that no thread is left alone
// with the end of a chunk.
constexpr std::size_t kRunReceivers = 32;

}  // namespace

ChunkGatherer::ChunkGatherer(PagedOctree& octree, const GatherOptions& options, int threads,
                             Progress& progress)
    : progress_(progress) {
  for (int i = 0; i < threads; ++i) {
    workers_.push_back(std::make_unique<Worker>(options, octree));
  }
}

ChunkGatherer::~ChunkGatherer() = default;

Status ChunkGatherer::gather(std::span<const OrderedReceiver> order,
                             std::span<const Receiver> receivers, std::span<GatherResult> results) {
  order_ = order;
  receivers_ = receivers;
  results_ = results;
  next_ = 0;
  {
    // This thread works too, and none is started that would find nothing to do
    const std::size_t runs = (order.size() + kRunReceivers - 1) / kRunReceivers;
    std::vector<std::jthread> threads;
    try {
      for (std::size_t i = 1; i < std::min(workers_.size(), runs); ++i) {
        threads.emplace_back([this, i] { work(*workers_[i]); });
      }
    } catch (const std::system_error& error) {
      fail(Status::failed(fmt::format("cannot start a thread: {}", error.what())));
    }
    work(*workers_[0]);
  }  // all threads have ended
  return failure_;
}

// Takes runs until none is left or some thread has failed. What is thrown ends here: past the
// border of a thread it would end the process.
void ChunkGatherer::work(Worker& worker) {
  try {
    while (!has_failed_) {
      const std::size_t begin = next_.fetch_add(kRunReceivers);
      if (begin >= order_.size()) return;
      const std::size_t count = std::min(kRunReceivers, order_.size() - begin);
      Status status = gatherRun(worker, order_.subspan(begin, count));
      if (!status.ok()) return fail(std::move(status));
    }
  } catch (const std::exception& exception) {
    fail(Status::failed(fmt::format("cannot gather: {}", exception.what())));
  }
}

Status ChunkGatherer::gatherRun(Worker& worker, std::span<const OrderedReceiver> run) {
  if (progress_.isCancelled()) return Status::interrupted();
  for (const OrderedReceiver& receiver : run) {
    SURFEIT_RETURN_IF_ERROR(worker.gatherer.gather(receivers_[receiver.index], worker.reader,
                                                   results_[receiver.index]));
  }
  progress_.advance(run.size());
  return {};
}

// Stops all threads. The first failure is the one that is told.
void ChunkGatherer::fail(Status status) {
  const std::lock_guard lock(mutex_);
  if (failure_.ok()) failure_ = std::move(status);
  has_failed_ = true;
}

}  // namespace surfeit
