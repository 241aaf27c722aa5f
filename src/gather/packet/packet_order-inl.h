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
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
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

// Of kStep receivers.
template <typename Kind>
class OwnOrders {
 public:
  OwnOrders(const PacketCanvas& canvas, const Patch* patches, std::size_t lane)
      : canvas_(canvas),
        patches_(patches),
        lane_(lane),
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
    std::vector<std::uint64_t>& scratch = *canvas_.scratch;
    if (scratch.size() < 2 * order.size()) scratch.resize(2 * order.size());
    const auto seen = std::span(scratch).first(order.size());
    const auto own = std::span(scratch).subspan(order.size(), order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      seen[i] = brush.LanesThatSee(patches_[draw_order::index(order[i])]);
    }
    for (std::size_t k = 0; k < lane_count_; ++k) {
      const PacketLanes& lanes = *canvas_.lanes;
      const glm::vec3 place(lanes.x[lane_ + k], lanes.y[lane_ + k], lanes.z[lane_ + k]);
      std::size_t count = 0;
      for (std::size_t i = 0; i < order.size(); ++i) {
        if ((seen[i] >> k & 1) == 0) continue;
        const std::uint32_t index = draw_order::index(order[i]);
        const glm::vec3 middle = patches_[index].position - place;
        own[count++] = draw_order::key(0, glm::dot(middle, middle), index);
      }
      std::sort(own.begin(), own.begin() + std::ptrdiff_t(count));
      const M only = hn::Eq(hn::Iota(D(), 0), Splat(float(k)));
      for (const std::uint64_t key : own.first(count)) {
        brush.DrawPatch(patches_[draw_order::index(key)], only);
      }
    }
  }

 private:
  const PacketCanvas& canvas_;
  const Patch* const patches_;
  const std::size_t lane_, lane_count_;
  std::uint64_t among_;  // distances of what lies among them are less
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
