#include "tune/look_up_trace.h"

#include <array>

#include "batch/paging_controller.h"
#include "batch/receiver_queue.h"

namespace surfeit {
namespace {

constexpr std::uint32_t kNoPage = 0xffffffffu;

}  // namespace

class LookUpTrace::Reader {
 public:
  Reader(PagedOctree::Reader& octree, std::uint32_t surfel_group_capacity)
      : octree_(octree), surfel_group_capacity_(surfel_group_capacity) {}

  // Where the look-ups of the next walk go.
  void tellTo(LookUps& every, LookUps* second) {
    every_ = &every;
    second_ = second;
    node_page_ = surfel_page_ = kNoPage;
  }

  Status checkVisits(std::uint64_t nodes, std::uint64_t surfels) const {
    return octree_.checkVisits(nodes, surfels);
  }

  // A page that is looked up again at once is a hit of any cache, and need not be told.
  Result<std::span<const Node>> nodes(const NodeRange& range) {
    const bool is_new = range.page != node_page_;
    node_page_ = range.page;
    tell([&](LookUps& look_ups) {
      ++look_ups.node_requests;
      if (is_new && look_ups.node_distances.isSampled(range.page)) {
        look_ups.node_distances.touch(range.page);
      }
    });
    return octree_.nodes(range);
  }

  // Groups are full but for the last of a slab, and no leaf reaches beyond its slab; so the pages
  // of a leaf are known without reading them.
  template <typename Visit>
  Status visitLeaf(const Node& leaf, Visit&&) {
    std::uint32_t page = leaf.page, first = leaf.first;
    for (std::uint64_t left = leaf.surfel_count; left > 0; ++page, first = 0) {
      const bool is_new = page != surfel_page_;
      surfel_page_ = page;
      tell([&](LookUps& look_ups) {
        ++look_ups.surfel_requests;
        if (is_new && look_ups.surfel_distances.isSampled(page)) {
          look_ups.surfel_distances.touch(page);
        }
      });
      const std::uint32_t rest =
          surfel_group_capacity_ - std::min(first, surfel_group_capacity_ - 1);
      left -= std::min<std::uint64_t>(left, rest);
    }
    return {};
  }

 private:
  template <typename Tell>
  void tell(Tell&& tell) {
    tell(*every_);
    if (second_ != nullptr) tell(*second_);
  }

  PagedOctree::Reader& octree_;
  const std::uint32_t surfel_group_capacity_;
  LookUps* every_ = nullptr;
  LookUps* second_ = nullptr;
  std::uint32_t node_page_ = kNoPage, surfel_page_ = kNoPage;  // of the last look-ups
};

LookUpTrace::LookUpTrace(PagedOctree& octree, const GatherRules& rules, int threads,
                         Progress& progress)
    : rules_(rules),
      threads_(static_cast<std::size_t>(threads)),
      progress_(progress),
      surfel_group_capacity_(octree.file().header().surfel_group_capacity),
      octree_(octree),
      cut_(std::make_unique<CutWalk>(rules)),
      cost_(rules) {}

// As PacketGatherer::gather walks.
Status LookUpTrace::walk(std::span<const LocalReceiver> receivers, Reader& reader) {
  const PacketCluster cluster(receivers);
  cost_.begin(cluster.receivers(0)[0].position);
  const std::span<const LocalReceiver> first = cluster.receivers(0).first(1);
  SURFEIT_RETURN_IF_ERROR(cut_->walk(viewPacket(first, rules_), first, reader, cost_));
  for (std::size_t i = 0; i < cluster.packetCount(); ++i) {
    const std::span<const LocalReceiver> packet = cluster.receivers(i);
    SURFEIT_RETURN_IF_ERROR(cost_.forEachPart(
        packet, cluster.mostPacketRadius(), [&](std::size_t begin, std::size_t count) {
          const std::span<const LocalReceiver> part = packet.subspan(begin, count);
          return cut_->walk(viewPacket(part, rules_), part, reader, IgnoreCut{});
        }));
  }
  return {};
}

Status LookUpTrace::follow(const NextRun& next, LookUps& every, LookUps* second) {
  struct Thread {
    Reader reader;
    std::vector<SortedReceiver> run;
    std::size_t place = 0;
  };
  std::vector<Thread> threads(threads_, Thread{Reader(octree_, surfel_group_capacity_), {}, 0});
  std::uint64_t walked = 0;
  for (bool is_at_end = false; !is_at_end;) {
    is_at_end = true;
    for (Thread& thread : threads) {
      if (thread.place == thread.run.size()) {
        SURFEIT_RETURN_IF_ERROR(next(thread.run));
        thread.place = 0;
        if (progress_.isCancelled()) return Status::interrupted();
        progress_.advance(thread.run.size());
      }
      if (thread.run.empty()) continue;
      is_at_end = false;
      const std::size_t count = std::min(kClusterReceivers, thread.run.size() - thread.place);
      std::array<LocalReceiver, kClusterReceivers> receivers;
      for (std::size_t i = 0; i < count; ++i) receivers[i] = thread.run[thread.place++].receiver;
      LookUps* const also = walked++ % 2 == 0 ? second : nullptr;
      thread.reader.tellTo(every, also);
      SURFEIT_RETURN_IF_ERROR(walk(std::span(receivers).first(count), thread.reader));
      every.receivers += count;
      if (also != nullptr) also->receivers += count;
    }
  }
  return {};
}

Status LookUpTrace::follow(std::span<const SortedReceiver> receivers, LookUps& every,
                           LookUps* second) {
  return follow(
      [&](std::vector<SortedReceiver>& run) {
        const auto count = std::min<std::size_t>(receivers.size(), PagingController::kFirstRun);
        run.assign(receivers.begin(), receivers.begin() + static_cast<std::ptrdiff_t>(count));
        receivers = receivers.subspan(count);
        return Status();
      },
      every, second);
}

}  // namespace surfeit
