#include "engine/engine_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace surfeit {
namespace {

// Tables of a frame, in its cache.
constexpr std::size_t kFrameTables = 64;

// Frames of all pages, but not fewer than gatherers need, and no more than there are.
std::size_t leastFrames(std::size_t pages, int gatherers) {
  return std::max<std::size_t>(1, PagedOctree::leastFrames(pages, std::max(gatherers, 1)));
}

double mebibytes(std::uint64_t bytes) { return std::ceil(double(bytes) / (1 << 20) * 10) / 10; }

}  // namespace

EngineState::EngineState(const EngineOptions& given, std::unique_ptr<OctreeCaches> made)
    : options(given), caches(std::move(made)), monitor(*caches, {}) {}

EngineState::EngineState(std::shared_ptr<OctreeCaches> planned, std::size_t front_slots,
                         const CacheMonitor::Options& monitoring)
    : caches(std::move(planned)), monitor(*caches, monitoring), planned_front_slots_(front_slots) {}

std::uint64_t EngineState::leastCacheBytes(int gatherers) const {
  return leastFrames(caches->nodePages(), gatherers) * (caches->nodeFrameBytes() + kFrameTables) +
         leastFrames(caches->surfelPages(), gatherers) *
             (caches->surfelFrameBytes() + kFrameTables);
}

Status EngineState::take(std::uint64_t bytes, int more_gatherers, const std::string& what) {
  if (planned_front_slots_) return {};
  const std::lock_guard lock(mutex);
  const std::uint64_t least = held_bytes + bytes + leastCacheBytes(gatherer_count + more_gatherers);
  if (least > options.memory_bytes) {
    return Status::budgetTooSmall(
        fmt::format("{}: an engine of {:.1f} MiB is too small for it, beside {:.1f} MiB that {} {} "
                    "and {} {} hold: {:.1f} MiB is the least that works",
                    what, mebibytes(options.memory_bytes), mebibytes(held_bytes),
                    scene_count.load(), scene_count == 1 ? "scene" : "scenes", gatherer_count,
                    gatherer_count == 1 ? "gatherer" : "gatherers", mebibytes(least)));
  }
  held_bytes += bytes;
  gatherer_count += more_gatherers;
  divideFrames();
  return {};
}

void EngineState::giveBack(std::uint64_t bytes, int fewer_gatherers) {
  if (planned_front_slots_) return;
  const std::lock_guard lock(mutex);
  held_bytes -= bytes;
  gatherer_count -= fewer_gatherers;
  divideFrames();
}

void EngineState::divide() {
  const std::lock_guard lock(mutex);
  divideFrames();
}

// In the ratio that the monitor has found, with what one cache cannot use given to the other.
void EngineState::divideFrames() {
  const std::size_t node_bytes = caches->nodeFrameBytes() + kFrameTables;
  const std::size_t surfel_bytes = caches->surfelFrameBytes() + kFrameTables;
  const std::size_t node_pages = std::max<std::size_t>(caches->nodePages(), 1);
  const std::size_t surfel_pages = std::max<std::size_t>(caches->surfelPages(), 1);
  const std::size_t least_nodes = leastFrames(node_pages, gatherer_count);
  const std::size_t least_surfels = leastFrames(surfel_pages, gatherer_count);
  const std::uint64_t left = options.memory_bytes - std::min(held_bytes, options.memory_bytes);

  const double now_nodes = double(caches->nodes().frameLimit() * node_bytes);
  const double now_all = now_nodes + double(caches->surfels().frameLimit() * surfel_bytes);
  auto for_nodes = static_cast<std::uint64_t>(double(left) * now_nodes / now_all);
  for_nodes =
      std::max(for_nodes, left - std::min<std::uint64_t>(left, surfel_pages * surfel_bytes));
  const std::size_t nodes = std::clamp<std::size_t>(for_nodes / node_bytes, least_nodes,
                                                    std::max(least_nodes, node_pages));
  const std::uint64_t for_surfels = left - std::min<std::uint64_t>(left, nodes * node_bytes);
  const std::size_t surfels = std::clamp<std::size_t>(for_surfels / surfel_bytes, least_surfels,
                                                      std::max(least_surfels, surfel_pages));
  // Where surfels had to have their least, nodes give way
  const std::uint64_t rest = left - std::min<std::uint64_t>(left, surfels * surfel_bytes);
  monitor.setFrames(std::clamp<std::size_t>(rest / node_bytes, least_nodes, nodes), surfels,
                    least_nodes, least_surfels);
}

std::size_t EngineState::frontSlots() const {
  if (planned_front_slots_) return *planned_front_slots_;
  const std::lock_guard lock(mutex);
  const int threads = std::max(options.threads, gatherer_count);
  return std::min(
      PagedOctree::frontSlots(caches->nodes().frameLimit(), caches->nodePages(), threads),
      PagedOctree::frontSlots(caches->surfels().frameLimit(), caches->surfelPages(), threads));
}

SceneState::~SceneState() {
  octree.reset();
  --engine->scene_count;
  engine->giveBack(held_bytes, 0);
}

}  // namespace surfeit
