// How brightly the receivers of a packet see patches that do not shine evenly, with lobes or
// slopes; for one instruction set (see
// packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_LOBE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_LOBE_INL_H_
#undef SURFEIT_PACKET_LOBE_INL_H_
#else
#define SURFEIT_PACKET_LOBE_INL_H_
#endif

#include <hwy/highway.h>
// Needs the instruction set that the former chose
#include <hwy/contrib/math/math-inl.h>

#include "core/spherical_harmonics.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/rules/lobe_light.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// What is sent in the lobe goes `gain` times as much towards a receiver as if it were sent evenly,
// which is 1 / pi of the radiosity in every direction above the surface. Over these directions the
// mean of the gain, weighted by the cosine, is 1 within 2 %; less where the lobe lies along the
// surface. Places on the patch lie in all directions from a receiver within it, so it sees the lobe
// as wide as both: a disk of area A varies by A / (4 pi) along each of its axes, foreshortened
// across.
void SeeLobe(const PacketLanes& lanes, std::size_t receiver_count, const Patch& patch,
             const LobeLight& lobe, PacketLights& lights) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1), k = Splat(lobe.concentration);
  for (std::size_t lane = 0; lane < receiver_count; lane += kStep) {
    const V3 offset = Receivers(lanes, lane).To(patch.position);
    const V inverse = InverseSqrt(hn::Max(Dot(offset, offset), Splat(1e-30f)));
    const V cosine = hn::Mul(Dot(offset, patch.normal), inverse);
    const V across = hn::Mul(Splat(patch.area / (8 * kPi)), hn::MulAdd(cosine, cosine, one));
    const V spread = hn::Min(one, hn::Mul(across, hn::Mul(inverse, inverse)));
    const V seen = hn::Div(k, hn::MulAdd(k, spread, one));
    const V off_axis = hn::Min(zero, hn::NegMulAdd(Dot(offset, lobe.axis), inverse, Splat(-1)));
    const V fallen = hn::Exp(d, hn::Mul(seen, off_axis));
    const V whole = hn::Sub(one, hn::Exp(d, hn::Mul(Splat(-2), seen)));
    const V gain = hn::Mul(hn::Div(seen, whole), hn::Mul(fallen, Splat(0.5f / lobe.facing)));
    for (int c = 0; c < 3; ++c) {
      const V part = hn::MulAdd(Splat(lobe.shares[c]), hn::Sub(gain, one), one);
      hn::Store(hn::Mul(Splat(patch.radiosity[c]), part), d,
                lights.colors[std::size_t(c)].data() + lane);
    }
  }
}

// docs/algorithm.md, "Contributions": x = n.v is spread evenly over [m - r, m + r], and brightness
// is 1 + slope.v (x - m) / r. Returned is the mean of (x - m) / r, over what is seen.
HWY_INLINE V SeenSlope(V m_over_r, bool is_two_sided) {
  const V one = Splat(1), third = Splat(1.f / 3);
  const V x = is_two_sided ? hn::Abs(m_over_r) : hn::Max(Splat(-1), m_over_r);
  const V square = hn::Mul(x, x);
  const V of_both = hn::Sub(
      hn::Div(hn::Mul(hn::Mul(Splat(2.f / 3), x), hn::Add(square, Splat(3))), hn::Add(square, one)),
      x);
  const V partly = is_two_sided ? of_both : hn::Mul(third, hn::Sub(Splat(2), x));
  return hn::IfThenElse(hn::Ge(x, one), hn::Div(third, hn::Max(x, one)), partly);
}

void SeeSlope(const PacketLanes& lanes, std::size_t receiver_count, const Patch& patch,
              const std::array<glm::vec3, 3>& slopes, float range, PacketLights& lights) {
  const D d;
  const bool is_two_sided = patch.seen == Patch::Seen::kBoth;
  for (std::size_t lane = 0; lane < receiver_count; lane += kStep) {
    const V3 offset = Receivers(lanes, lane).To(patch.position);
    const V inverse = InverseSqrt(hn::Max(Dot(offset, offset), Splat(1e-30f)));
    const V m = hn::Mul(hn::Neg(Dot(offset, patch.normal)), inverse);
    V seen = hn::Mul(SeenSlope(hn::Mul(m, Splat(1 / range)), is_two_sided), inverse);
    if (is_two_sided) seen = hn::IfThenElse(hn::Lt(m, hn::Zero(d)), hn::Neg(seen), seen);
    for (std::size_t c = 0; c < 3; ++c) {
      const V gain = hn::NegMulAdd(Dot(offset, slopes[c]), seen, Splat(1));
      float* const at = lights.colors[c].data() + lane;
      hn::Store(hn::Mul(hn::Max(hn::Zero(d), gain), hn::Load(d, at)), d, at);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
