// Gathers at receivers in memory, in clusters of the order in which they come.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/guard.h"
#include "core/surfel_limits.h"
#include "core/surfel_normal.h"
#include "engine/gatherer_state.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

bool isFinite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

GatherResult noResult(std::uint32_t outputs) {
  std::array<float, kResultFloats> row;
  row.fill(std::numeric_limits<float>::quiet_NaN());
  return unpackResult(row.data(), outputs);
}

}  // namespace

Gatherer::State::State(std::shared_ptr<const World> of)
    : gatherer(std::move(of)), no_result(noResult(world().rules().outputs)) {
  local.resize(gatherer.size());
  places.resize(gatherer.size());
  found.resize(gatherer.size());
}

Gatherer::State::~State() { world().engine().giveBack(world().gathererBytes(), 1); }

bool Gatherer::State::toLocal(const Receiver& receiver, LocalReceiver& result) const {
  const glm::dvec3 place = receiver.position - world().origin();
  for (int axis = 0; axis < 3; ++axis) {
    if (!(std::abs(place[axis]) <= double(kLargestLength))) return false;
  }
  if (!isFinite(receiver.normal) || !isFinite(receiver.view)) return false;
  result.position = glm::vec3(place);
  const glm::dvec3 normal(receiver.normal), view_direction(receiver.view);
  if (normalise(normal.x, normal.y, normal.z, result.normal) == NormalKind::kTooShort) return false;
  const double length = glm::length(view_direction);
  result.view = length > 0 ? glm::vec3(view_direction / length) : glm::vec3(0);
  const GatherRules& rules = world().rules();
  if (!rules.isGlossy()) return true;
  return !result.isSpherical() && (length > 0 || isFinite(rules.eye));
}

// At most a group.
Status Gatherer::State::gatherGroup(std::span<const Receiver> receivers,
                                    std::span<GatherResult> results) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (toLocal(receivers[i], local[count])) {
      places[count++] = static_cast<std::uint32_t>(i);
    } else {
      results[i] = no_result;
      ++invalid_receivers;
    }
  }
  const auto gathered = std::span(found).first(count);
  if (count > 0) {
    const auto at = std::span<const LocalReceiver>(local).first(count);
    SURFEIT_RETURN_IF_ERROR(gatherer.gather(at, gathered));
  }
  for (std::size_t i = 0; i < count; ++i) results[places[i]] = gathered[i];
  done_receivers += receivers.size();
  world().engine().monitor.advance(receivers.size());
  return {};
}

Gatherer::Gatherer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Gatherer::Gatherer(Gatherer&&) noexcept = default;
Gatherer& Gatherer::operator=(Gatherer&&) noexcept = default;
Gatherer::~Gatherer() = default;

Status Gatherer::gather(const Receiver* receivers, std::size_t count, GatherResult* results,
                        const Progress* progress) {
  // Two threads on one gatherer would spoil each other's results without a word
  if (state_->is_busy.exchange(true, std::memory_order_acquire)) {
    return Status::invalidArgument("gather: another call on this gatherer has not returned");
  }
  const Status status = guarded("gather", [&]() -> Status {
    const std::size_t group_size = state_->gatherer.size();
    for (std::size_t begin = 0; begin < count; begin += group_size) {
      if (progress != nullptr && progress->isCancelled()) return Status::interrupted();
      const std::size_t size = std::min(group_size, count - begin);
      SURFEIT_RETURN_IF_ERROR(
          state_->gatherGroup({receivers + begin, size}, {results + begin, size}));
    }
    return {};
  });
  state_->is_busy.store(false, std::memory_order_release);
  return status;
}

void Gatherer::pause() { state_->gatherer.reader().release(); }

std::uint64_t Gatherer::receivers() const { return state_->done_receivers; }
std::uint64_t Gatherer::invalidReceivers() const { return state_->invalid_receivers; }

Result<Gatherer> Gatherer::another() const {
  return guarded("gatherer", [&] { return make(state_->gatherer.sharedWorld()); });
}

Result<Gatherer> Gatherer::make(std::shared_ptr<const World> world) {
  SURFEIT_RETURN_IF_ERROR(world->engine().take(world->gathererBytes(), 1, "a gatherer"));
  try {
    return Gatherer(std::make_unique<State>(world));
  } catch (...) {
    world->engine().giveBack(world->gathererBytes(), 1);
    throw;
  }
}

}  // namespace surfeit
