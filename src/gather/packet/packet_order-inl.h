// The order in which every receiver of a packet is shown what lies among them; for one instruction
// set (see packet_kernel-inl.h). docs/algorithm.md, "Packets".
#if defined(SURFEIT_PACKET_ORDER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_ORDER_INL_H_
#undef SURFEIT_PACKET_ORDER_INL_H_
#else
#define SURFEIT_PACKET_ORDER_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gather/packet/packet_brush-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/rules/fidelity.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// Of kStep receivers. From the packet's centre, two patches in one direction of a receiver are the
// other way round only where the sum of their distances from that receiver is less than twice the
// packet's radius, so both lie within that radius of the centre.
template <typename Kind>
class OwnOrders {
 public:
  OwnOrders(const PacketCanvas& canvas, const Patch* patches, std::size_t lane)
      : canvas_(canvas),
        patches_(patches),
        lane_count_(std::min(kStep, canvas.receiver_count - lane)) {
    const float radius = kFidelity.own_order * canvas.packet_radius;
    among_ = draw_order::distance(draw_order::key(0, radius * radius, 0));
  }

  // How much of this order, which begins a face, lies among the receivers.
  std::size_t Count(std::span<const std::uint64_t> order) const {
    std::size_t count = 0;
    while (count < order.size() && draw_order::face(order[count]) == draw_order::face(order[0]) &&
           draw_order::distance(order[count]) < among_) {
      ++count;
    }
    return count;
  }

  // Draws these to one receiver after the other, in the order of its own distances.
  void Draw(Brush<Kind>& brush, std::span<const std::uint64_t> order) const {
    std::vector<std::uint64_t>& own = *canvas_.scratch;
    if (own.size() < lane_count_ * order.size()) own.resize(lane_count_ * order.size());
    std::array<std::size_t, kStep> counts{};
    HWY_ALIGN std::array<float, kStep> distances;
    for (const std::uint64_t key : order) {
      const std::uint32_t index = draw_order::index(key);
      V distance_sq;
      std::uint32_t seen = brush.LanesThatSee(patches_[index], distance_sq);
      hn::Store(distance_sq, D(), distances.data());
      for (std::size_t k = 0; k < lane_count_; ++k, seen >>= 1) {
        if ((seen & 1) == 0) continue;
        own[k * order.size() + counts[k]++] = draw_order::key(0, distances[k], index);
      }
    }
    for (std::size_t k = 0; k < lane_count_; ++k) {
      const auto keys = std::span(own).subspan(k * order.size(), counts[k]);
      std::sort(keys.begin(), keys.end());
      const M only = hn::Eq(hn::Iota(D(), 0), Splat(float(k)));
      for (const std::uint64_t key : keys) brush.DrawPatch(patches_[draw_order::index(key)], only);
    }
  }

 private:
  const PacketCanvas& canvas_;
  const Patch* const patches_;
  const std::size_t lane_count_;
  std::uint64_t among_;  // distances of what lies among them are less
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
