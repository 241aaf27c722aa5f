// Lobes of patches as the receivers of a packet see them; for one instruction set (see
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

// The radiosity of a patch: LobeLight::part. Places on the patch lie in all directions from a
// receiver within it, so it sees the lobe as wide as both: a disk of area A varies by A / (4 pi)
// along each of its axes, foreshortened across.
HWY_INLINE V3 RadiosityTowards(const Patch& patch, const LobeLight* lobes, const Sight& sight) {
  const V3 even = {Splat(patch.radiosity.x), Splat(patch.radiosity.y), Splat(patch.radiosity.z)};
  if (patch.lobe == 0) return even;
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  const LobeLight& lobe = lobes[patch.lobe];
  const V distance_sq = hn::Max(sight.distance_sq, Splat(1e-30f));
  const V inverse = InverseSqrt(distance_sq);
  const V cosine = hn::Mul(sight.facing, inverse);
  const V spread =
      hn::Min(one, hn::Mul(hn::Mul(Splat(patch.area / (8 * kPi)), hn::MulAdd(cosine, cosine, one)),
                           hn::Mul(inverse, inverse)));
  const V k = Splat(lobe.concentration);
  const V seen = hn::Div(k, hn::MulAdd(k, spread, one));
  const V off_axis = hn::Min(zero, hn::NegMulAdd(Dot(sight.offset, lobe.axis), inverse, Splat(-1)));
  const V fallen = hn::Exp(d, hn::Mul(seen, off_axis));
  const V whole = hn::Sub(one, hn::Exp(d, hn::Mul(Splat(-2), seen)));
  const V gain = hn::Mul(hn::Div(seen, whole), hn::Mul(fallen, Splat(0.5f / lobe.facing)));
  const V more = hn::Sub(gain, one);
  return {hn::Mul(even.x, hn::MulAdd(Splat(lobe.shares.x), more, one)),
          hn::Mul(even.y, hn::MulAdd(Splat(lobe.shares.y), more, one)),
          hn::Mul(even.z, hn::MulAdd(Splat(lobe.shares.z), more, one))};
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
