// The receivers of a packet in lanes, and how they see a patch; for one instruction set (see
// packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_LANES_INL_H_
#undef SURFEIT_PACKET_LANES_INL_H_
#else
#define SURFEIT_PACKET_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>

#include "gather/cut/vectors_of_3-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/rules/coverage_rules.h"
#include "octree/node/hidden_layers.h"
#include "octree/node/stored_loss.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kPacketReceivers>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
constexpr std::size_t kStep = hn::MaxLanes(D());

inline V Splat(float value) { return hn::Set(D(), value); }
// Lanes as bits, the first one lowest.
inline std::uint32_t LaneBits(M lanes) {
  std::uint8_t bytes[8] = {};  // as many as are stored at least
  static_assert(kStep <= 16);
  hn::StoreMaskBits(D(), lanes, bytes);
  return bytes[0] | std::uint32_t{bytes[1]} << 8;
}
inline V LoadLanes(const std::array<float, kPacketReceivers>& column, std::size_t lane) {
  return hn::Load(D(), column.data() + lane);
}

// Values of the pixels of a face, for the kStep receivers from `lane` on, which lie together: all
// pixels of these, then all of the next. What one vector draws fits a near cache so, as far as
// it is seen. `channels`: values of a pixel and receiver.
class FaceLanes {
 public:
  FaceLanes() = default;
  FaceLanes(float* values, const PacketCanvas& canvas, std::size_t face, std::size_t lane,
            std::size_t channels)
      : values_(values +
                (face * kPacketReceivers + lane) * channels * canvas.geometry->facePixels()),
        pixel_floats_(channels * kStep) {}
  // Of a pixel of the face; kStep of a channel, then of the next.
  float* at(std::size_t pixel) const { return values_ + pixel * pixel_floats_; }

 private:
  float* values_ = nullptr;
  std::size_t pixel_floats_ = 0;
};

// One step of Newton's method on the machine's estimate: 22 bits or more everywhere.
inline V Reciprocal(V x) {
  const V estimate = hn::ApproximateReciprocal(x);
  return hn::Mul(estimate, hn::NegMulAdd(x, estimate, Splat(2)));
}
inline V InverseSqrt(V x) {
  const V estimate = hn::ApproximateReciprocalSqrt(x);
  const V half = hn::Mul(Splat(0.5f), x);
  return hn::Mul(estimate, hn::NegMulAdd(hn::Mul(half, estimate), estimate, Splat(1.5f)));
}

// What lies where in a pixel counts by its own weight there. Of what was open, and of the weight
// that was left, this part of the weight goes to what covers `covered`, the middle of which weighs
// `weight` beside the middle of the pixel. What lies by itself takes its own; what takes all that
// is open, all that is left: that tells what the middle of a patch that is half hidden does not.
// Zero where nothing is open.
inline V TakenWeight(V covered, V open, V rest, V weight) {
  const V zero = hn::Zero(D()), one = Splat(1);
  const V part = hn::Div(covered, hn::Max(open, Splat(1e-30f)));
  const V own = hn::Mul(hn::Mul(covered, hn::Sub(one, part)), weight);
  const V taken = hn::MulAdd(hn::Mul(part, part), rest, own);
  return hn::IfThenElseZero(hn::Gt(covered, zero), hn::Min(rest, hn::Max(zero, taken)));
}

using V3 = VectorsOf3<V>;
inline V Axis(const V3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
inline V Axis(const glm::vec3& v, int axis) { return Splat(v[axis]); }
// Along the axes u and v of a face, and towards it.
template <typename Vector>
HWY_INLINE V3 AlongFace(const Vector& v, int face) {
  const int axis = face / 2;
  return {Axis(v, (axis + 1) % 3), Axis(v, (axis + 2) % 3),
          hn::Mul(Splat(face % 2 == 0 ? 1.f : -1.f), Axis(v, axis))};
}

// Frames of the lanes' cones.
struct Frames {
  V3 x, y, z;
  Frames(const PacketLanes& lanes, std::size_t lane)
      : x{LoadLanes(lanes.frame[0], lane), LoadLanes(lanes.frame[1], lane),
          LoadLanes(lanes.frame[2], lane)},
        y{LoadLanes(lanes.frame[3], lane), LoadLanes(lanes.frame[4], lane),
          LoadLanes(lanes.frame[5], lane)},
        z{LoadLanes(lanes.frame[6], lane), LoadLanes(lanes.frame[7], lane),
          LoadLanes(lanes.frame[8], lane)} {}
  template <typename Vector>
  V3 ToLocal(const Vector& v) const {
    return {Dot(x, v), Dot(y, v), Dot(z, v)};
  }
  // A matrix times one of the axes.
  V3 Times(const SymmetricMatrix& m, int axis) const {
    const V3& v = axis == 0 ? x : axis == 1 ? y : z;
    const glm::vec3 rows[3] = {
        {m(0, 0), m(0, 1), m(0, 2)}, {m(1, 0), m(1, 1), m(1, 2)}, {m(2, 0), m(2, 1), m(2, 2)}};
    return {Dot(v, rows[0]), Dot(v, rows[1]), Dot(v, rows[2])};
  }
  // A component of v = (x, y, z) in the frame, of the world.
  V ToWorld(const glm::vec3& v, int axis) const {
    return hn::MulAdd(Axis(x, axis), Splat(v.x),
                      hn::MulAdd(Axis(y, axis), Splat(v.y), hn::Mul(Axis(z, axis), Splat(v.z))));
  }
};

// Some of the receivers.
struct Receivers {
  V3 position, normal;
  M spherical;

  Receivers(const PacketLanes& lanes, std::size_t lane)
      : position{LoadLanes(lanes.x, lane), LoadLanes(lanes.y, lane), LoadLanes(lanes.z, lane)},
        normal{LoadLanes(lanes.normal_x, lane), LoadLanes(lanes.normal_y, lane),
               LoadLanes(lanes.normal_z, lane)},
        spherical(hn::Gt(LoadLanes(lanes.spherical, lane), hn::Zero(D()))) {}

  V3 To(const glm::vec3& place) const {
    return {hn::Sub(Splat(place.x), position.x), hn::Sub(Splat(place.y), position.y),
            hn::Sub(Splat(place.z), position.z)};
  }
  // Those that see what is this high above their horizons.
  M SeeAt(V height) const { return hn::Or(spherical, hn::Gt(height, hn::Zero(D()))); }
};

// A patch as some of the receivers see it.
struct Sight {
  V3 offset;  // from the receivers
  V distance_sq, height;
  V facing;     // offset . normal: negative in front
  M in_reach;   // not too far away, and for spheres around spherical receivers, not too close
  V near_part;  // of what is seen, as nearPart
  V bias;       // of rays
  M traced;     // near in part, and seen by the rays
};

// How much of what is so far away is ray traced: it fades as nodes do.
inline V NearPart(const Patch& patch, const Sight& sight) {
  // Finite and positive, for a surfel may be at a receiver; then it is near at any setting
  const float inverse =
      1 / std::clamp(patch.near_distance * patch.near_distance, std::numeric_limits<float>::min(),
                     std::numeric_limits<float>::max());
  const float width = std::max(2 * kFidelity.fading, std::numeric_limits<float>::min());
  const V rest = hn::NegMulAdd(sight.distance_sq, Splat(inverse), Splat(1));
  const V part = hn::Mul(rest, Splat(1 / width));
  return hn::Min(Splat(1), hn::Max(hn::Zero(D()), part));
}

// Gives a two-sided disk its bias, and tells the lanes that may see it. One within 45 degrees of
// the receiver's plane that is no higher than the bias is of the receiver's own sheet. That is seen
// from the side of the receiver's normal alone; all others have no bias. Layers are told apart by
// gaps kClearGap times as wide as they are thick, so of layers that part of the bias decides.
HWY_INLINE M ShowsOfTwoSided(Sight& sight, V cosine, float most, bool is_layered) {
  const V thickness = Splat(is_layered ? most / kClearGap : most);
  const M is_own =
      hn::And(hn::Gt(hn::Mul(cosine, cosine), Splat(0.5f)), hn::Le(sight.height, thickness));
  sight.bias = hn::IfThenElseZero(is_own, Splat(most));
  const V facing = hn::NegMulAdd(sight.bias, cosine, sight.facing);  // where rays begin
  return hn::Or(hn::Not(is_own), hn::Lt(hn::Mul(facing, cosine), hn::Zero(D())));
}

HWY_INLINE Sight See(const PacketCanvas& canvas, const Patch& patch, const Receivers& receivers) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  Sight sight;
  sight.offset = receivers.To(patch.position);
  sight.distance_sq = Dot(sight.offset, sight.offset);
  sight.height = Dot(sight.offset, receivers.normal);
  sight.facing = Dot(sight.offset, patch.normal);
  sight.in_reach = hn::Le(sight.distance_sq, Splat(canvas.max_distance_sq));
  sight.traced = hn::Gt(zero, zero);
  sight.near_part = zero;
  sight.bias = zero;
  if (!(patch.near_distance > 0)) return sight;

  if (patch.isRound()) {
    // A receiver without a normal is a sphere as well: those that touch it are its own surface
    const float clearance = 2 * patch.radius;
    const M too_close =
        hn::And(receivers.spherical, hn::Lt(sight.distance_sq, Splat(clearance * clearance)));
    sight.in_reach = hn::AndNot(too_close, sight.in_reach);
  }
  sight.near_part = hn::IfThenElseZero(sight.in_reach, NearPart(patch, sight));
  const M is_near = hn::Gt(sight.near_part, zero);
  if (hn::AllFalse(d, is_near)) return sight;

  // The bias keeps disks of the receiver's own surface from covering it. What faces the receiver
  // closely is none of those, and would be looked through. So the bias fades out with the normal.
  // (A dragon on a plane: AO RMSE .0254 with a constant bias, .0218 so.) Ribbons are as rough as
  // they are wide. (AO RMSE of hair .0088; .0117 with radii.)
  const V cosine = Dot(receivers.normal, patch.normal);
  const GatherQuality& quality = canvas.rules->quality;
  const bool is_turned = patch.seen == Patch::Seen::kFront && quality.sides == GatherSides::kBack;
  const float most = quality.bias * (patch.is_ribbon ? patch.ribbon_width : patch.radius);
  M shows = is_near;
  if (patch.seen == Patch::Seen::kBoth) {
    shows = hn::And(is_near, ShowsOfTwoSided(sight, cosine, most, patch.is_layered));
  } else {
    const V part = is_turned ? hn::Sub(one, cosine) : hn::Add(one, cosine);
    // Where a disk and the receiver lie in one plane, rounding of their places decides nothing
    const float rounding = std::min(most, 2 * kPositionTolerance * patch.radius);
    sight.bias = hn::Max(Splat(rounding), hn::Mul(Splat(most), hn::Min(one, part)));
  }
  // Along the receiver's normal a disk reaches radius * sin(angle of normals) above its middle. It
  // must rise above the horizon of the rays, which the receiver's own surface does not
  const V rise =
      hn::Mul(Splat(patch.radius), hn::Sqrt(hn::Max(zero, hn::NegMulAdd(cosine, cosine, one))));
  const M rises = hn::Or(receivers.spherical, hn::Gt(hn::Add(sight.height, rise), sight.bias));
  sight.traced = hn::And(shows, rises);

  // ... and show its front, or the sphere its outside, to where the rays begin
  if (patch.seen == Patch::Seen::kFront) {
    sight.traced =
        hn::And(sight.traced, hn::Lt(hn::NegMulAdd(sight.bias, cosine, sight.facing), zero));
  } else if (patch.isRound()) {
    const V along =
        hn::MulAdd(sight.bias, sight.bias,
                   hn::NegMulAdd(hn::Mul(Splat(2), sight.bias), sight.height, sight.distance_sq));
    sight.traced = hn::And(sight.traced, hn::Gt(along, Splat(patch.radius * patch.radius)));
  }
  return sight;
}

// Lanes to which the patch is a patch of solid angle: the mid or the far field.
HWY_INLINE M SeenAsPatch(const Patch& patch, const Receivers& receivers, const Sight& sight) {
  const M seen = hn::And(hn::And(hn::Lt(sight.near_part, Splat(1)), sight.in_reach),
                         receivers.SeeAt(sight.height));
  if (patch.seen != Patch::Seen::kFront) return seen;
  return hn::And(seen, hn::Lt(sight.facing, hn::Zero(D())));
}

// From where the rays begin.
HWY_INLINE V3 RayStartTo(const Sight& sight, const Receivers& receivers) {
  return {hn::NegMulAdd(sight.bias, receivers.normal.x, sight.offset.x),
          hn::NegMulAdd(sight.bias, receivers.normal.y, sight.offset.y),
          hn::NegMulAdd(sight.bias, receivers.normal.z, sight.offset.z)};
}

// Half of the side of the box around the disk along an axis, on which its normal is `n`.
inline V HalfSide(const Patch& patch, V n) {
  if (patch.isRound()) return Splat(patch.radius);
  return hn::Mul(Splat(patch.radius),
                 hn::Sqrt(hn::Max(hn::Zero(D()), hn::NegMulAdd(n, n, Splat(1)))));
}

// How much of it counts: each receiver has its own part while a node fades into what is below it.
inline V PartsOf(const PacketCanvas& canvas, const Patch& patch, std::size_t lane) {
  return patch.parts == 0 ? Splat(1) : LoadLanes(canvas.parts[patch.parts].of, lane);
}

// At the rim of a curved thing, a part of a piece faces the receiver whose mean normal does not:
// as SeeRoughNode has it, with normals spread evenly. All times the distance.
inline V RimCosine(V facing, V range) {
  const V sum = hn::Max(hn::Zero(D()), hn::Sub(range, facing));
  const V rim = hn::Div(hn::Mul(sum, sum), hn::Mul(Splat(4), range));
  return hn::IfThenElse(hn::Lt(hn::Neg(facing), range), rim, hn::Neg(facing));
}

// Fronts and backs together.
inline V RimOfBoth(V cosine, V range) {
  const V rim = hn::Div(hn::MulAdd(cosine, cosine, hn::Mul(range, range)), hn::Add(range, range));
  return hn::IfThenElse(hn::Lt(cosine, range), rim, cosine);
}

// The part of its outline that a patch covers when it is spread over it: 1 where it fills it.
// `half_area`: a quarter of its own area on the face; `spread_sq`: the determinant of its spread
// there, where it is one unit away.
inline V EvenPart(const Patch& patch, V half_area, V spread_sq, V inverse_sq) {
  // Of the ellipse with its covariance a rectangle fills this
  constexpr float kOfRectangle = 3 / kPi;
  constexpr float kLeast = 0.01f;  // lest what shows nothing is divided by 0
  // The ellipse is 4 pi times the root of the determinant of the covariance, which is the spread
  // times a sixth of the square of the radius
  const float scale = 4 / (kPi * patch.radius * patch.radius * 2 / 3);
  const V ellipse_inverse = hn::Div(InverseSqrt(spread_sq), inverse_sq);
  const V fill = hn::Mul(hn::Mul(Splat(scale), half_area), ellipse_inverse);
  const float steepness = (kOfRectangle - kFidelity.least_filled) / kFidelity.least_filled;
  const V even = hn::Div(fill, hn::NegMulAdd(Splat(steepness), fill, Splat(kOfRectangle)));
  return hn::IfThenElse(hn::Lt(fill, Splat(kFidelity.least_filled)), hn::Max(even, Splat(kLeast)),
                        Splat(1));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
