// Gathers at any number of receivers in memory, in the order of a curve, on several threads.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "core/curve_key.h"
#include "core/first_failure.h"
#include "core/guard.h"
#include "core/worker_threads.h"
#include "engine/gatherer_state.h"
#include "octree/page/scene_header.h"

namespace surfeit {
namespace {

bool isFinite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// The cells of a curve, and what positions in it are counted from.
struct Curve {
  RootCube cube;
  glm::dvec3 origin{0};
};

// One scene has the curve of its own pages, as jobs on files do. A world of instances has none; a
// curve through the receivers' bounds serves as well.
Curve curveOf(const World& world, const ReceiverArray& receivers) {
  if (world.instances() == nullptr) {
    return {world.file().header().cube, world.origin()};
  }
  Bounds3d bounds;
  for (std::size_t i = 0; i < receivers.count(); ++i) {
    const glm::dvec3 position = receivers.receiver(i).position;
    if (isFinite(position)) bounds.add(position);
  }
  const glm::dvec3 half = 0.5 * bounds.extent();
  return {rootCube(Bounds3d{-half, half}), bounds.centre()};
}

// Hands out runs of receivers in order, each the group that a gatherer takes at once.
class GroupedReceivers {
 public:
  GroupedReceivers(ReceiverArray& receivers, std::vector<std::uint32_t> order, std::size_t run)
      : receivers_(receivers), order_(std::move(order)), run_(run) {}

  // Gathers until none is left, or something has failed.
  Status gatherAll(Gatherer& gatherer, const FirstFailure& failure, Progress& progress) {
    std::vector<Receiver> run;
    std::vector<GatherResult> found(run_);
    while (!failure.happened()) {
      const std::size_t begin = next_.fetch_add(run_);
      if (begin >= order_.size()) return {};
      const std::size_t end = std::min(order_.size(), begin + run_);
      run.clear();
      for (std::size_t i = begin; i < end; ++i) run.push_back(receivers_.receiver(order_[i]));
      SURFEIT_RETURN_IF_ERROR(gatherer.gather(run.data(), run.size(), found.data(), &progress));
      for (std::size_t i = begin; i < end; ++i) receivers_.setResult(order_[i], found[i - begin]);
      progress.advance(end - begin);
    }
    return {};
  }

 private:
  ReceiverArray& receivers_;
  const std::vector<std::uint32_t> order_;
  const std::size_t run_;
  std::atomic<std::size_t> next_{0};
};

// A part of the engine's budget. The caches give way meanwhile.
class BudgetPart {
 public:
  explicit BudgetPart(EngineState& engine) : engine_(engine) {}
  BudgetPart(const BudgetPart&) = delete;
  BudgetPart& operator=(const BudgetPart&) = delete;
  ~BudgetPart() { engine_.giveBack(bytes_, 0); }

  Status take(std::uint64_t bytes, const std::string& what) {
    SURFEIT_RETURN_IF_ERROR(engine_.take(bytes, 0, what));
    bytes_ += bytes;
    return {};
  }
  void giveBack(std::uint64_t bytes) {
    engine_.giveBack(bytes, 0);
    bytes_ -= bytes;
  }

 private:
  EngineState& engine_;
  std::uint64_t bytes_ = 0;
};

}  // namespace

// Receivers that are not valid come last: they must not change the company of the others.
std::vector<std::uint32_t> Gatherer::State::curveOrder(const ReceiverArray& receivers) const {
  const Curve curve = curveOf(world(), receivers);
  std::vector<CurveKey> keys(receivers.count(), ~CurveKey{0});
  LocalReceiver valid;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const Receiver receiver = receivers.receiver(i);
    if (!toLocal(receiver, valid)) continue;
    keys[i] = curveKey(glm::vec3(receiver.position - curve.origin), curve.cube);
  }
  std::vector<std::uint32_t> order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
  });
  return order;
}

Status Gatherer::gatherAll(ReceiverArray& receivers, Progress& progress, int threads) {
  return guarded("gather", [&]() -> Status {
    const std::size_t count = receivers.count();
    if (count == 0) return {};
    if (count > std::numeric_limits<std::uint32_t>::max()) {
      return Status::invalidArgument(
          fmt::format("{} receivers at once, expected less than 2^32: call it for parts", count));
    }
    if (threads <= 0) threads = state_->world().engine().options.threads;
    const std::size_t run = state_->gatherer.size();
    const std::size_t runs = (count + run - 1) / run;
    progress.beginPhase("gather", count, "receivers");
    BudgetPart order_part(state_->world().engine());
    const std::uint64_t key_bytes = count * sizeof(CurveKey);
    SURFEIT_RETURN_IF_ERROR(order_part.take(key_bytes + count * sizeof(std::uint32_t),
                                            fmt::format("the order of {} receivers", count)));
    GroupedReceivers groups(receivers, state_->curveOrder(receivers), run);
    order_part.giveBack(key_bytes);
    std::vector<Gatherer> others;
    while (others.size() + 1 < std::min(runs, static_cast<std::size_t>(threads))) {
      Result<Gatherer> more = another();
      if (!more.ok()) break;  // fewer do the same in a longer time
      others.push_back(std::move(*more));
    }
    std::atomic<std::size_t> taken{0};
    FirstFailure failure;
    return runOnThreads(int(others.size()) + 1, failure, "gather", [&] {
      const std::size_t number = taken.fetch_add(1);
      if (number == 0) return groups.gatherAll(*this, failure, progress);
      Gatherer& own = others[number - 1];
      const Status status = groups.gatherAll(own, failure, progress);
      own.pause();
      return status;
    });
  });
}

}  // namespace surfeit
