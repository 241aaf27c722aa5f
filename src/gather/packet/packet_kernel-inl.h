// Body of packet_kernel.cpp for one instruction set. Lanes are receivers; a vector holds as many of
// the 16 as the machine can, and everything is done for one vector after the other. No include
// guard but Highway's: it is read once per instruction set.
#if defined(SURFEIT_PACKET_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_KERNEL_INL_H_
#undef SURFEIT_PACKET_KERNEL_INL_H_
#else
#define SURFEIT_PACKET_KERNEL_INL_H_
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "core/spherical_harmonics.h"
#include "gather/packet/packet_brush-inl.h"
#include "gather/packet/packet_integral-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/packet_lobe-inl.h"
#include "gather/packet/packet_order-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// The faces that boxes with these half sides around these centres reach, in lanes of `seen`.
std::uint32_t FacesThatReach(const V3& centre, const V3& half, M seen) {
  const D d;
  const V3 far = {hn::Add(hn::Abs(centre.x), half.x), hn::Add(hn::Abs(centre.y), half.y),
                  hn::Add(hn::Abs(centre.z), half.z)};
  const V3 near = {hn::Sub(hn::Abs(centre.x), half.x), hn::Sub(hn::Abs(centre.y), half.y),
                   hn::Sub(hn::Abs(centre.z), half.z)};
  std::uint32_t faces = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const V c = Axis(centre, axis), h = Axis(half, axis);
    const M wide = hn::And(seen, hn::Ge(Axis(far, axis), hn::Max(Axis(near, u), Axis(near, v))));
    const M before = hn::And(wide, hn::Ge(hn::Add(c, h), hn::Zero(d)));
    const M behind = hn::And(wide, hn::Ge(h, c));
    faces |= (hn::AllFalse(d, before) ? 0u : 1u) << 2 * axis;
    faces |= (hn::AllFalse(d, behind) ? 0u : 1u) << (2 * axis + 1);
  }
  return faces;
}

// How far from its middle a patch may be drawn, in sides: at the edge of a face, where it matters,
// everything shows larger by the root of 2, and sides need not be equal.
constexpr float kSplatReach = 0.9f;
// Side of a thicket, in radii of the node: with outlines as long as the node, and a sheared image.
constexpr float kThicketSide = 3;
// Areas over the square of the distance along the axis from where on it matters how long patches
// are and what perspective makes of them: they go to every face that they may be drawn to. (Against
// all patches on every face, in a hollow sphere: with .2 occlusion is off by up to .0016 at .11 sr
// and by .019 at .4, with .02 by .0001 and .0006, for 3 % of the time.)
constexpr float kLargeExtent = 0.02f;

HWY_ATTR std::uint32_t FacesThatSee(const PacketCanvas& canvas, const Patch& patch) {
  const D d;
  std::uint32_t faces = 0;
  for (std::size_t lane = 0; lane < canvas.receiver_count; lane += kStep) {
    const Receivers receivers(*canvas.lanes, lane);
    const Sight sight = See(canvas, patch, receivers);
    const M splatted = SeenAsPatch(patch, receivers, sight);
    if (hn::AllFalse(d, hn::Or(splatted, sight.traced))) continue;
    if (canvas.rules->hasConeRaster()) return 1;
    if (!hn::AllFalse(d, sight.traced)) {
      const V3 half = {HalfSide(patch, Splat(patch.normal.x)),
                       HalfSide(patch, Splat(patch.normal.y)),
                       HalfSide(patch, Splat(patch.normal.z))};
      faces |= FacesThatReach(RayStartTo(sight, receivers), half, sight.traced);
    }
    if (!hn::AllFalse(d, splatted)) {
      const V largest = hn::Max(hn::Abs(sight.offset.x),
                                hn::Max(hn::Abs(sight.offset.y), hn::Abs(sight.offset.z)));
      float side = patch.is_ribbon ? patch.area / patch.ribbon_width : std::sqrt(patch.most_area);
      if (patch.isRound() && patch.is_alone && patch.near_distance == 0) {
        side = std::max(side, kThicketSide * patch.radius);
      }
      const V reach = hn::MulAdd(Splat(0.5f * kLargeExtent), largest, Splat(kSplatReach * side));
      const V least = hn::Mul(Splat(kFidelity.least_axis), hn::Sqrt(sight.distance_sq));
      const M is_large =
          hn::Gt(Splat(patch.area), hn::Mul(Splat(kLargeExtent), hn::Mul(largest, largest)));
      const V from = hn::IfThenElse(is_large, least, hn::Max(least, hn::Sub(largest, reach)));
      for (int axis = 0; axis < 3; ++axis) {
        const V c = Axis(sight.offset, axis);
        const M before = hn::And(splatted, hn::Ge(c, from));
        const M behind = hn::And(splatted, hn::Ge(hn::Neg(c), from));
        faces |= (hn::AllFalse(d, before) ? 0u : 1u) << 2 * axis;
        faces |= (hn::AllFalse(d, behind) ? 0u : 1u) << (2 * axis + 1);
      }
    }
  }
  return faces;
}

// docs/algorithm.md, "Contributions". Power over area has x spread evenly over [m - r, m + r], and
// is never negative, as the truncated series is: T m for m >= r, 0 for m <= -r, T (m + r)^2 / (4 r)
// between. T m and T r are `mean` and `range` below, of all four kinds of coefficients at once.
// What shows nearly nothing sends the mean.
void SeeRoughNode(const Node& node, const glm::vec3& direction, RoughSight& sight) {
  const hn::CappedTag<float, kNodeShKinds> d4;
  const ShCoefficients basis = shBasis(-direction);
  alignas(16) std::array<float, kNodeShKinds> facing_of, total_of, mean_of, band_2_of;
  for (std::size_t kind = 0; kind < kNodeShKinds; kind += hn::Lanes(d4)) {
    const auto term = [&](std::size_t i) {
      return hn::Mul(hn::LoadU(d4, node.rough.sh[i].data() + kind), hn::Set(d4, basis[i]));
    };
    const auto plus = [&](auto sum, std::size_t i) {
      return hn::MulAdd(hn::LoadU(d4, node.rough.sh[i].data() + kind), hn::Set(d4, basis[i]), sum);
    };
    const auto zero = hn::Zero(d4);
    const auto band_1 = plus(plus(term(1), 2), 3);
    const auto band_2 = plus(plus(plus(plus(term(4), 5), 6), 7), 8);
    const auto total = hn::Mul(hn::Set(d4, 4.f), term(0));
    const auto mean = hn::Add(band_1, band_1);
    // (total + 6.4 band_2) / 3 is the mean square; range^2 = 3 (total * mean square - mean^2)
    const auto mean_sq = hn::MulAdd(hn::Set(d4, 6.4f), band_2, total);
    const auto range_sq =
        hn::NegMulAdd(hn::Mul(hn::Set(d4, 3.f), mean), mean, hn::Mul(total, mean_sq));
    const auto range = hn::Sqrt(hn::Max(zero, range_sq));
    const auto sum = hn::Add(mean, range);
    const auto between =
        hn::Div(hn::Mul(sum, sum), hn::Max(hn::Mul(hn::Set(d4, 4.f), range), hn::Set(d4, 1e-37f)));
    const auto partly = hn::IfThenElse(hn::Le(sum, zero), zero, between);
    const auto facing = hn::IfThenElse(hn::Ge(mean, range), mean, partly);
    hn::Store(facing, d4, facing_of.data() + kind);
    hn::Store(total, d4, total_of.data() + kind);
    hn::Store(mean, d4, mean_of.data() + kind);
    hn::Store(band_2, d4, band_2_of.data() + kind);
  }
  const float total = total_of[kAreaKind], second = 3.2f * band_2_of[kAreaKind];
  const float fourth = shEvaluate(node.rough.area_band_4, shBand4(-direction));
  sight.facing = facingAreas(total, mean_of[kAreaKind], second, fourth);
  const float area = facing_of[kAreaKind];
  sight.radiosity = node.radiosity;
  if (area > kFidelity.least_visible_part * node.area) {
    const float inverse = 1 / area;
    for (int c = 0; c < 3; ++c) sight.radiosity[c] = inverse * facing_of[powerKind(c)];
  }
}

// Patches are fetched so long before they are drawn: they lie in another order.
constexpr std::size_t kPatchesAhead = 3;

template <typename Kind>
void DrawAll(const PacketCanvas& canvas, const Patch* patches,
             std::span<const std::uint64_t> order) {
  const auto patchOf = [&](std::uint64_t key) { return patches + draw_order::index(key); };
  for (std::size_t lane = 0; lane < canvas.receiver_count; lane += kStep) {
    Brush<Kind> brush(canvas, lane);
    int face = -1;
    OwnOrders<Kind> own_orders(canvas, patches, lane);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto* const later = reinterpret_cast<const char*>(
          patchOf(order[std::min(i + kPatchesAhead, order.size() - 1)]));
      hwy::Prefetch(later);
      hwy::Prefetch(later + sizeof(Patch) / 2);
      if (draw_order::face(order[i]) != face) {
        if (face >= 0) brush.EndFace();
        face = draw_order::face(order[i]);
        brush.BeginFace(face);
        (*canvas.is_face_used)[std::size_t(face)] = true;
        const std::size_t among = own_orders.Count(order.subspan(i));
        if (among > 1) {
          own_orders.Draw(brush, order.subspan(i, among));
          i += among - 1;
          continue;
        }
      }
      brush.DrawPatch(*patchOf(order[i]));
    }
    if (face >= 0) brush.EndFace();
  }
}

void Draw(const PacketCanvas& canvas, const Patch* patches, std::span<const std::uint64_t> order) {
  const GatherRules& rules = *canvas.rules;
  const auto with = [](bool is, const auto& next) {
    is ? next(std::true_type()) : next(std::false_type());
  };
  with(rules.hasLight(), [&](auto color) {
    with(rules.fades(), [&](auto fade) {
      with(rules.hasConeRaster(), [&](auto frame) {
        DrawAll<BrushKind<color.value, fade.value, frame.value>>(canvas, patches, order);
      });
    });
  });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
