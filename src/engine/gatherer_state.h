// What is behind a Gatherer.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/thread_gatherer.h"
#include "surfeit/engine.h"

namespace surfeit {

struct Gatherer::State {
  // The engine has given the bytes of a gatherer.
  explicit State(std::shared_ptr<const World> of);
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State();

  // False for one that is not valid.
  bool toLocal(const Receiver& receiver, LocalReceiver& result) const;
  Status gatherGroup(std::span<const Receiver> receivers, std::span<GatherResult> results);
  // Indices of the receivers along a curve.
  std::vector<std::uint32_t> curveOrder(const ReceiverArray& receivers) const;

  const World& world() const { return gatherer.world(); }

  ThreadGatherer gatherer;
  const GatherResult no_result;

  // Of a group
  std::vector<LocalReceiver> local;
  std::vector<std::uint32_t> places;
  std::vector<GatherResult> found;

  std::uint64_t done_receivers = 0, invalid_receivers = 0;
  std::atomic<bool> is_busy{false};  // a call is on its way
};

}  // namespace surfeit
