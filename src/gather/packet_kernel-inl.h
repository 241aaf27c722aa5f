// Body of packet_kernel.cpp for one instruction set. Lanes are receivers; a vector holds as many of
// the 16 as the machine can, and everything is done for one vector after the other. No include
// guard but Highway's: it is read once per instruction set.
#if defined(SURFEIT_PACKET_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_KERNEL_INL_H_
#undef SURFEIT_PACKET_KERNEL_INL_H_
#else
#define SURFEIT_PACKET_KERNEL_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"
#include "gather/coverage_rules.h"
#include "gather/packet_kernel.h"

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
inline V LoadLanes(const std::array<float, kPacketReceivers>& column, std::size_t lane) {
  return hn::Load(D(), column.data() + lane);
}

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

struct V3 {
  V x, y, z;
};
inline V Dot(const V3& a, const V3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
inline V Dot(const V3& a, const glm::vec3& b) {
  return hn::MulAdd(a.x, Splat(b.x), hn::MulAdd(a.y, Splat(b.y), hn::Mul(a.z, Splat(b.z))));
}
inline V Axis(const V3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// Some of the receivers.
struct Receivers {
  V3 position, normal;
  M spherical;

  Receivers(const PacketLanes& lanes, std::size_t lane)
      : position{LoadLanes(lanes.x, lane), LoadLanes(lanes.y, lane), LoadLanes(lanes.z, lane)},
        normal{LoadLanes(lanes.normal_x, lane), LoadLanes(lanes.normal_y, lane),
               LoadLanes(lanes.normal_z, lane)},
        spherical(hn::Gt(LoadLanes(lanes.spherical, lane), hn::Zero(D()))) {}
};

// A patch as some of the receivers see it.
struct Sight {
  V3 offset;  // from the receivers
  V distance_sq, height;
  V facing;    // offset . normal: negative in front
  M in_reach;  // not too far away, and for spheres around spherical receivers, not too close
  M is_near;
  V bias;    // of rays: see ReceiverRaster::rayBias
  M traced;  // near, and seen by the rays
};

HWY_INLINE Sight See(const PacketCanvas& canvas, const Patch& patch, const Receivers& receivers) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  Sight sight;
  sight.offset = {hn::Sub(Splat(patch.position.x), receivers.position.x),
                  hn::Sub(Splat(patch.position.y), receivers.position.y),
                  hn::Sub(Splat(patch.position.z), receivers.position.z)};
  sight.distance_sq = Dot(sight.offset, sight.offset);
  sight.height = Dot(sight.offset, receivers.normal);
  sight.facing = Dot(sight.offset, patch.normal);
  sight.in_reach = hn::Le(sight.distance_sq, Splat(canvas.max_distance_sq));
  sight.is_near = sight.traced = hn::Gt(zero, zero);
  sight.bias = zero;
  if (!(patch.near_distance > 0)) return sight;

  if (patch.isRound()) {
    const float clearance = kSphereClearance * patch.radius;
    const M too_close =
        hn::And(receivers.spherical, hn::Lt(sight.distance_sq, Splat(clearance * clearance)));
    sight.in_reach = hn::AndNot(too_close, sight.in_reach);
  }
  sight.is_near = hn::And(
      sight.in_reach, hn::Lt(sight.distance_sq, Splat(patch.near_distance * patch.near_distance)));
  if (hn::AllFalse(d, sight.is_near)) return sight;

  // As ReceiverRaster::addSurfel: the disk must rise above the horizon of the rays
  const V cosine = Dot(receivers.normal, patch.normal);
  sight.bias = hn::Mul(Splat(canvas.bias * patch.radius), hn::Min(one, hn::Add(one, cosine)));
  const V rise =
      hn::Mul(Splat(patch.radius), hn::Sqrt(hn::Max(zero, hn::NegMulAdd(cosine, cosine, one))));
  const M rises = hn::Or(receivers.spherical, hn::Gt(hn::Add(sight.height, rise), sight.bias));
  sight.traced = hn::And(sight.is_near, rises);

  // ... and show its front, or the sphere its outside, to where the rays begin
  if (patch.facing_limit == Patch::kFrontOnly) {
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
  const M above = hn::Or(receivers.spherical, hn::Gt(sight.height, hn::Zero(D())));
  const M faces = hn::Lt(sight.facing, Splat(patch.facing_limit));
  return hn::And(hn::AndNot(sight.is_near, sight.in_reach), hn::And(above, faces));
}

HWY_ATTR bool IsSeen(const PacketCanvas& canvas, const Patch& patch) {
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    const Receivers receivers(*canvas.lanes, lane);
    const Sight sight = See(canvas, patch, receivers);
    if (!hn::AllFalse(D(), hn::Or(sight.traced, SeenAsPatch(patch, receivers, sight)))) return true;
  }
  return false;
}

// All four kinds of coefficients at once; the derivation is at projectedSum.
void SeeRoughNode(const Node& node, const glm::vec3& direction, RoughSight& sight) {
  const hn::CappedTag<float, kNodeShKinds> d4;
  const ShCoefficients basis = shBasis(-direction);
  alignas(16) std::array<float, kNodeShKinds> facing_of, opposite_of;
  for (std::size_t kind = 0; kind < kNodeShKinds; kind += hn::Lanes(d4)) {
    const auto term = [&](std::size_t i) {
      return hn::Mul(hn::LoadU(d4, node.sh[i].data() + kind), hn::Set(d4, basis[i]));
    };
    const auto plus = [&](auto sum, std::size_t i) {
      return hn::MulAdd(hn::LoadU(d4, node.sh[i].data() + kind), hn::Set(d4, basis[i]), sum);
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
    hn::Store(hn::Sub(facing, mean), d4, opposite_of.data() + kind);
  }
  sight.area = facing_of[kAreaKind];
  sight.opposite_area = opposite_of[kAreaKind];
  sight.power = {facing_of[powerKind(0)], facing_of[powerKind(1)], facing_of[powerKind(2)]};
}

// How some of the receivers' pixels are covered.
struct Cover {
  V depth_begin, depth_end;
  M is_lit;
  bool is_all_lit;
  float overlap;
  glm::vec3 radiosity;
};

// As RasterCube::coverPixel, where `amount` is positive.
template <bool kColor>
inline void CoverPixel(float* pixel, V amount, const Cover& cover) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  float* const room_at = pixel;
  float* const layer_at = pixel + kPacketReceivers;
  float* const end_at = pixel + 2 * kPacketReceivers;
  const V end = hn::Load(d, end_at);
  V room = hn::Load(d, room_at), before = hn::Load(d, layer_at);

  // A gap in depth begins a new layer
  const M touched = hn::Gt(amount, zero);
  const M is_new = hn::And(touched, hn::Gt(cover.depth_begin, end));
  room = hn::IfThenElse(is_new, hn::NegMulAdd(room, before, room), room);
  before = hn::IfThenZeroElse(is_new, before);
  hn::Store(room, d, room_at);
  hn::Store(hn::IfThenElse(touched, hn::Max(end, cover.depth_end), end), d, end_at);

  const V middle = hn::Min(one, hn::MulAdd(Splat(0.5f), amount, before));
  const V slope =
      hn::MulAdd(middle, hn::MulAdd(Splat(3 * kFill), middle, Splat(-cover.overlap)), one);
  const V layer = hn::Min(one, hn::MulAdd(amount, slope, before));
  hn::Store(layer, d, layer_at);
  if constexpr (kColor) {
    V added = hn::Mul(room, hn::Sub(layer, before));
    if (!cover.is_all_lit) added = hn::IfThenElseZero(cover.is_lit, added);
    for (std::size_t c = 0; c < PacketCanvas::kColorChannels; ++c) {
      float* const at = pixel + (PacketCanvas::kCoverageChannels + c) * kPacketReceivers;
      hn::Store(hn::MulAdd(added, Splat(cover.radiosity[int(c)]), hn::Load(d, at)), d, at);
    }
  }
}

// Pixels of a face, half open.
struct PixelRange {
  int column_begin, column_end, row_begin, row_end;
  bool isEmpty() const { return column_begin >= column_end || row_begin >= row_end; }
};

// The pixels that rectangles [x0, x1] x [y0, y1], in pixels within the face, reach in lanes of
// `active`.
inline PixelRange RangeOf(M active, V x0, V x1, V y0, V y1, int resolution) {
  const D d;
  const V far_away = Splat(float(resolution));
  PixelRange range;
  range.column_begin = int(hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(active, x0, far_away))));
  range.row_begin = int(hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(active, y0, far_away))));
  const float x_end = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(active, x1)));
  const float y_end = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(active, y1)));
  range.column_end = std::min(resolution, int(x_end) + 1);
  range.row_end = std::min(resolution, int(y_end) + 1);
  return range;
}

// As RasterCube::Parallelogram, in pixels.
struct Parallelogram {
  V x, y, half_x, half_y, shear;
};

template <bool kColor>
class Brush {
 public:
  Brush(const PacketCanvas& canvas, std::size_t lane)
      : canvas_(canvas),
        lane_(lane),
        resolution_(canvas.geometry->resolution()),
        receivers_(*canvas.lanes, lane) {}

  // What follows draws to this face alone.
  void BeginFace(int face) {
    face_ = face;
    pixels_ = canvas_.pixels + std::size_t(face * resolution_ * resolution_) * kPixelFloats;
    if (!(*canvas_.is_face_used)[std::size_t(face)]) ClearFace();
    pixels_ += lane_;
  }

  HWY_INLINE void DrawPatch(const Patch& patch) {
    const Sight sight = See(canvas_, patch, receivers_);
    if (!hn::AllFalse(D(), sight.traced)) Trace(patch, sight);
    const M seen = SeenAsPatch(patch, receivers_, sight);
    if (!hn::AllFalse(D(), seen)) SplatPatch(patch, sight, seen);
  }

 private:
  static constexpr std::size_t kPixelFloats = PacketCanvas::pixelFloats(kColor);

  // For all lanes.
  void ClearFace() {
    const D d;
    float* at = pixels_;
    for (int i = 0; i < resolution_ * resolution_; ++i) {
      for (std::size_t lane = 0; lane < kPixelFloats; lane += kStep) {
        hn::Store(Splat(lane < kPacketReceivers ? 1.f : 0.f), d, at + lane);
      }
      at += kPixelFloats;
    }
    (*canvas_.is_face_used)[std::size_t(face_)] = true;
  }

  Cover MakeCover(const Patch& patch, const Sight& sight, V distance) const {
    const V reach = Splat(kLayerReach * patch.radius);
    Cover cover;
    cover.depth_begin = hn::Sub(distance, reach);
    cover.depth_end = hn::Add(distance, reach);
    cover.is_all_lit = patch.facing_limit != Patch::kDarkBack;
    cover.overlap = patch.overlap;
    cover.is_lit = hn::Lt(sight.facing, hn::Zero(D()));
    cover.radiosity = patch.radiosity;
    return cover;
  }

  // As RasterCube::splat, onto face_.
  HWY_INLINE void SplatPatch(const Patch& patch, const Sight& sight, M seen) {
    const V w = hn::Mul(Splat(face_ % 2 == 0 ? 1.f : -1.f), Axis(sight.offset, face_ / 2));
    const V inverse = InverseSqrt(sight.distance_sq);
    const V distance = hn::Mul(sight.distance_sq, inverse);
    seen = hn::And(seen, hn::Gt(w, hn::Mul(Splat(kLeastAxis), distance)));
    if (hn::AllFalse(D(), seen)) return;

    // The visible area, times the distance
    const V area = hn::Min(hn::MulAdd(Splat(patch.disk_area), hn::Abs(sight.facing),
                                      hn::Mul(Splat(patch.round_area), distance)),
                           hn::Mul(Splat(patch.most_area), distance));
    // Numbers of lanes that see nothing must be numbers, too
    const V inverse_w = Reciprocal(hn::IfThenElse(seen, w, Splat(1)));
    CoverParallelogram(OnFace(patch, sight, hn::IfThenElseZero(seen, area), inverse_w), seen,
                       MakeCover(patch, sight, distance));
  }

  // As RasterCube::onFace; `area` is the visible area times the distance.
  HWY_INLINE Parallelogram OnFace(const Patch& patch, const Sight& sight, V area, V inverse) const {
    const V one = Splat(1), least = Splat(kLeastSpread);
    const int axis = face_ / 2, u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
    const V u = hn::Mul(Axis(sight.offset, u_axis), inverse);
    const V v = hn::Mul(Axis(sight.offset, v_axis), inverse);
    const float n = face_ % 2 == 0 ? patch.normal[axis] : -patch.normal[axis];
    const V n_axis = Splat(n);
    const V g_u = hn::NegMulAdd(u, n_axis, Splat(patch.normal[u_axis]));
    const V g_v = hn::NegMulAdd(v, n_axis, Splat(patch.normal[v_axis]));

    // The spread of a disk, and what is left of a row's when it is sheared
    const V a = hn::Max(least, hn::NegMulAdd(g_u, g_u, hn::MulAdd(u, u, one)));
    const V c = hn::Max(least, hn::NegMulAdd(g_v, g_v, hn::MulAdd(v, v, one)));
    const V b = hn::NegMulAdd(g_u, g_v, hn::Mul(u, v));
    const V inverse_c = Reciprocal(c);
    const V shear = hn::Mul(b, inverse_c);
    const V row_a = hn::Max(hn::Mul(least, a), hn::NegMulAdd(b, shear, a));
    const V ratio_sq = hn::Mul(row_a, inverse_c);
    const V ratio = hn::Mul(ratio_sq, InverseSqrt(ratio_sq));

    // Area on the face: du dv = area / distance^2 * (distance / w)^3, and more for large ones
    const V inverse_sq = hn::Mul(inverse, inverse);
    const V extent = hn::Min(Splat(kMostExtent), hn::Mul(Splat(patch.area), inverse_sq));
    const V bulge = hn::MulAdd(extent, Splat(0.5f * (1 - n * n)), one);
    const V half_area =
        hn::Mul(hn::Mul(Splat(0.25f), area), hn::Mul(hn::Mul(inverse, inverse_sq), bulge));
    const V half_u_sq = hn::Max(hn::Mul(half_area, ratio), Splat(1e-30f));
    const V inverse_half_u = InverseSqrt(half_u_sq);
    const V shift = hn::Mul(extent, Splat(1.f / 3));
    const V scale = Splat(0.5f * float(resolution_));
    const V middle_u = hn::MulAdd(shift, hn::MulAdd(n_axis, g_u, u), u);
    const V middle_v = hn::MulAdd(shift, hn::MulAdd(n_axis, g_v, v), v);
    return {hn::MulAdd(middle_u, scale, scale), hn::MulAdd(middle_v, scale, scale),
            hn::Mul(hn::Mul(half_u_sq, inverse_half_u), scale),
            hn::Mul(hn::Mul(half_area, inverse_half_u), scale), shear};
  }

  // Covers pixels by the part of them that lies in the shape, row by row.
  HWY_INLINE void CoverParallelogram(const Parallelogram& shape, M seen, const Cover& cover) {
    const D d;
    const V zero = hn::Zero(d), size = Splat(float(resolution_));
    const V reach = hn::MulAdd(hn::Abs(shape.shear), shape.half_y, shape.half_x);
    const V x0 = hn::Max(zero, hn::Sub(shape.x, reach));
    const V x1 = hn::Min(size, hn::Add(shape.x, reach));
    const V y0 = hn::Max(zero, hn::Sub(shape.y, shape.half_y));
    const V y1 = hn::Min(size, hn::Add(shape.y, shape.half_y));
    seen = hn::And(seen, hn::And(hn::Lt(x0, x1), hn::Lt(y0, y1)));
    if (hn::AllFalse(d, seen)) return;
    const PixelRange range = RangeOf(seen, x0, x1, y0, y1, resolution_);
    if (range.isEmpty()) return;

    const V half_x = hn::IfThenElseZero(seen, shape.half_x);  // 0: no width
    for (int row = range.row_begin; row < range.row_end; ++row) {
      const V bottom = hn::Max(y0, Splat(float(row))), top = hn::Min(y1, Splat(float(row + 1)));
      const V height = hn::Max(zero, hn::Sub(top, bottom));
      const V along = hn::NegMulAdd(Splat(0.5f), hn::Add(top, bottom), shape.y);
      const V x = hn::NegMulAdd(shape.shear, along, shape.x);
      const V left = hn::Sub(x, half_x), right = hn::Add(x, half_x);
      float* pixel = pixels_ + std::size_t(row * resolution_ + range.column_begin) * kPixelFloats;
      for (int column = range.column_begin; column < range.column_end; ++column) {
        const V width = hn::Max(zero, hn::Sub(hn::Min(right, Splat(float(column + 1))),
                                              hn::Max(left, Splat(float(column)))));
        CoverPixel<kColor>(pixel, hn::Mul(width, height), cover);
        pixel += kPixelFloats;
      }
    }
  }

  // As RasterCube::traceDisk and traceSphere.
  void Trace(const Patch& patch, const Sight& sight) {
    const V3 centre = {hn::NegMulAdd(sight.bias, receivers_.normal.x, sight.offset.x),
                       hn::NegMulAdd(sight.bias, receivers_.normal.y, sight.offset.y),
                       hn::NegMulAdd(sight.bias, receivers_.normal.z, sight.offset.z)};
    Sight from_ray = sight;
    from_ray.facing = Dot(centre, patch.normal);
    const Cover cover = MakeCover(patch, from_ray, hn::Sqrt(sight.distance_sq));
    const V centre_sq = Dot(centre, centre);
    const bool is_sphere = patch.isRound();
    // Half the sides of the box around the disk
    const glm::vec3& normal = patch.normal;
    const glm::vec3 half =
        patch.radius *
        (is_sphere ? glm::vec3(1) : glm::sqrt(glm::max(glm::vec3(0), 1.f - normal * normal)));
    TraceBox(patch, centre, half, sight.traced, from_ray.facing, centre_sq, cover);
  }

  void TraceBox(const Patch& patch, const V3& centre, const glm::vec3& half, M traced, V c_n,
                V centre_sq, const Cover& cover) {
    const D d;
    const int axis = face_ / 2;
    const V w = hn::Mul(Splat(face_ % 2 == 0 ? 1.f : -1.f), Axis(centre, axis));
    const V w_far = hn::Add(w, Splat(half[axis]));
    traced = hn::And(traced, hn::Gt(w_far, hn::Zero(d)));
    if (hn::AllFalse(d, traced)) return;

    // Pixels that see the box; what lies behind the face's origin reaches everywhere
    const V inverse_far = Reciprocal(w_far);
    const V inverse_near =
        Reciprocal(hn::Max(hn::Sub(w, Splat(half[axis])), hn::Mul(w_far, Splat(1e-3f))));
    V x0, x1, y0, y1;
    Slopes(Axis(centre, (axis + 1) % 3), half[(axis + 1) % 3], inverse_near, inverse_far, x0, x1);
    Slopes(Axis(centre, (axis + 2) % 3), half[(axis + 2) % 3], inverse_near, inverse_far, y0, y1);
    const PixelRange range = RangeOf(traced, x0, x1, y0, y1, resolution_);
    if (range.isEmpty()) return;

    const std::size_t face_first = std::size_t(face_ * resolution_ * resolution_);
    for (int row = range.row_begin; row < range.row_end; ++row) {
      for (int column = range.column_begin; column < range.column_end; ++column) {
        const std::size_t in_face = std::size_t(row * resolution_ + column);
        const glm::vec3& ray = canvas_.geometry->pixels()[face_first + in_face].direction;
        const V amount = hn::IfThenElseZero(
            traced, patch.isRound() ? SphereAmount(patch, ray, centre, centre_sq)
                                    : DiskAmount(patch, ray, centre, c_n, centre_sq));
        if (hn::AllFalse(d, hn::Gt(amount, hn::Zero(d)))) continue;
        CoverPixel<kColor>(pixels_ + in_face * kPixelFloats, amount, cover);
      }
    }
  }

  // Pixel coordinates between which directions to [x - half, x + half] lie, one to spare.
  void Slopes(V x, float half, V inverse_near, V inverse_far, V& begin, V& end) const {
    const V zero = hn::Zero(D()), size = Splat(float(resolution_));
    const V scale = Splat(0.5f * float(resolution_));
    const V low = hn::Sub(x, Splat(half)), high = hn::Add(x, Splat(half));
    const V slope_low = hn::Mul(low, hn::IfThenElse(hn::Lt(low, zero), inverse_near, inverse_far));
    const V slope_high =
        hn::Mul(high, hn::IfThenElse(hn::Lt(high, zero), inverse_far, inverse_near));
    const V spare = Splat(0.01f);
    begin = hn::Min(size, hn::Max(zero, hn::Sub(hn::MulAdd(slope_low, scale, scale), spare)));
    end = hn::Min(size, hn::Max(zero, hn::Add(hn::MulAdd(slope_high, scale, scale), spare)));
  }

  static V SphereAmount(const Patch& patch, const glm::vec3& ray, const V3& centre, V centre_sq) {
    const V along = Dot(centre, ray);
    const V power = hn::Sub(centre_sq, Splat(patch.radius * patch.radius));
    const M hit = hn::And(hn::Gt(along, hn::Zero(D())), hn::Ge(hn::Mul(along, along), power));
    return hn::IfThenElseZero(hit, Splat(1));
  }

  // How much of the ray's pixel the soft disk covers; zero or less where the ray misses it.
  static V DiskAmount(const Patch& patch, const glm::vec3& ray, const V3& centre, V c_n,
                      V centre_sq) {
    const float d_n = glm::dot(ray, patch.normal);
    const V t = hn::Mul(c_n, Splat(1 / (d_n != 0 ? d_n : 1e-20f)));
    const V along = Dot(centre, ray);
    const V miss_sq = hn::MulAdd(t, hn::NegMulAdd(Splat(2), along, t), centre_sq);
    const V part_sq = hn::Mul(miss_sq, Splat(1 / (patch.radius * patch.radius)));
    const V peak = Splat(patch.soft_peak);
    const V amount = hn::Min(Splat(1), hn::NegMulAdd(peak, part_sq, peak));
    return hn::IfThenElseZero(hn::Gt(t, hn::Zero(D())), hn::Max(amount, hn::Zero(D())));
  }

  const PacketCanvas& canvas_;
  const std::size_t lane_;
  const int resolution_;
  const Receivers receivers_;
  int face_ = 0;
  float* pixels_ = nullptr;  // of the face, from the first of our lanes
};

template <bool kColor>
void DrawAll(const PacketCanvas& canvas, const Patch* patches,
             std::span<const std::uint64_t> order) {
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    Brush<kColor> brush(canvas, lane);
    int face = -1;
    for (const std::uint64_t key : order) {
      if (draw_order::face(key) != face) {
        face = draw_order::face(key);
        brush.BeginFace(face);
      }
      brush.DrawPatch(patches[draw_order::index(key)]);
    }
  }
}

void Draw(const PacketCanvas& canvas, const Patch* patches, std::span<const std::uint64_t> order) {
  canvas.has_color ? DrawAll<true>(canvas, patches, order) : DrawAll<false>(canvas, patches, order);
}

void FinishFarField(const PacketCanvas& canvas) {
  const D d;
  const V one = Splat(1);
  const std::size_t pixel_count = canvas.geometry->pixels().size();
  const std::size_t pixel_floats = PacketCanvas::pixelFloats(canvas.has_color);
  for (std::size_t i = 0; i < pixel_count; ++i) {
    if (!(*canvas.is_face_used)[i * RasterGeometry::kFaces / pixel_count]) continue;
    for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
      float* const pixel = canvas.pixels + i * pixel_floats + lane;
      const V room = hn::Load(d, pixel), layer = hn::Load(d, pixel + kPacketReceivers);
      const V total = hn::Sub(one, hn::NegMulAdd(room, layer, room));
      hn::Store(total, d, pixel);
      if (!canvas.has_color) continue;
      const V inverse = hn::Div(one, hn::Max(total, Splat(1e-20f)));
      for (std::size_t c = 3 * kPacketReceivers; c < pixel_floats; c += kPacketReceivers) {
        hn::Store(hn::Mul(hn::Load(d, pixel + c), inverse), d, pixel + c);
      }
    }
  }
}

// Sums over the pixels for some of the receivers.
class Integral {
 public:
  Integral(const PacketCanvas& canvas, const SharedFarField* far, std::size_t lane)
      : canvas_(canvas), far_(far), lane_(lane), receivers_(*canvas.lanes, lane) {
    weight_sum_ = covered_ = red_ = green_ = blue_ = hn::Zero(D());
  }

  void Add(std::size_t face, std::size_t first, std::size_t end) {
    const bool has_near = (*canvas_.is_face_used)[face];
    const bool has_far = far_ != nullptr && (*far_->canvas->is_face_used)[face];
    const V spherical = hn::IfThenElseZero(receivers_.spherical, Splat(1));
    for (std::size_t i = first; i < end; ++i) {
      const RasterGeometry::Pixel& pixel = canvas_.geometry->pixels()[i];
      const V cosine = hn::Max(spherical, Dot(receivers_.normal, pixel.direction));
      const V weight = hn::Mul(cosine, Splat(pixel.solid_angle));
      weight_sum_ = hn::Add(weight_sum_, weight);
      if (has_near || has_far) AddPixel(i, weight, has_near, has_far);
    }
  }

  void Store(std::array<std::array<float, kPacketReceivers>, 4>& out) const {
    const D d;
    const V inverse = hn::Div(Splat(1), weight_sum_);
    hn::Store(hn::Mul(covered_, inverse), d, out[0].data() + lane_);
    hn::Store(hn::Mul(red_, inverse), d, out[1].data() + lane_);
    hn::Store(hn::Mul(green_, inverse), d, out[2].data() + lane_);
    hn::Store(hn::Mul(blue_, inverse), d, out[3].data() + lane_);
  }

 private:
  void AddPixel(std::size_t i, V weight, bool has_near, bool has_far) {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const std::size_t pixel_floats = PacketCanvas::pixelFloats(canvas_.has_color);
    V room = one, layer = zero, end = zero;
    if (has_near) {
      const float* const near = canvas_.pixels + i * pixel_floats + lane_;
      room = hn::Load(d, near);
      layer = hn::Load(d, near + kPacketReceivers);
      end = hn::Load(d, near + 2 * kPacketReceivers);
      if (canvas_.has_color) {
        red_ = hn::MulAdd(weight, hn::Load(d, near + 3 * kPacketReceivers), red_);
        green_ = hn::MulAdd(weight, hn::Load(d, near + 4 * kPacketReceivers), green_);
        blue_ = hn::MulAdd(weight, hn::Load(d, near + 5 * kPacketReceivers), blue_);
      }
    }
    // The far field comes last, as one contribution: a surface that reaches it goes on there
    const float* far = nullptr;
    if (has_far) far = far_->canvas->pixels + i * pixel_floats + far_->lane;
    if (has_far && *far > 0) {
      const V amount = Splat(*far);
      const M is_new = hn::Gt(Splat(far_->distance), end);
      room = hn::IfThenElse(is_new, hn::NegMulAdd(room, layer, room), room);
      layer = hn::IfThenZeroElse(is_new, layer);
      const V after = hn::Min(hn::Add(layer, amount), one);
      if (canvas_.has_color) {
        const V added = hn::Mul(weight, hn::Mul(room, hn::Sub(after, layer)));
        red_ = hn::MulAdd(added, Splat(far[3 * kPacketReceivers]), red_);
        green_ = hn::MulAdd(added, Splat(far[4 * kPacketReceivers]), green_);
        blue_ = hn::MulAdd(added, Splat(far[5 * kPacketReceivers]), blue_);
      }
      layer = after;
    }
    const V total = hn::Sub(one, hn::NegMulAdd(room, layer, room));
    covered_ = hn::MulAdd(weight, total, covered_);
  }

  const PacketCanvas& canvas_;
  const SharedFarField* const far_;
  const std::size_t lane_;
  const Receivers receivers_;
  V weight_sum_, covered_, red_, green_, blue_;
};

// As ReceiverRaster::integrate.
void Integrate(const PacketCanvas& canvas, const SharedFarField* far,
               std::span<GatherResult> results) {
  const std::size_t face_pixels = canvas.geometry->pixels().size() / RasterGeometry::kFaces;
  alignas(64) std::array<std::array<float, kPacketReceivers>, 4> out;
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    Integral integral(canvas, far, lane);
    for (std::size_t face = 0; face < RasterGeometry::kFaces; ++face) {
      integral.Add(face, face * face_pixels, (face + 1) * face_pixels);
    }
    integral.Store(out);
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i] = {out[0][i], {out[1][i], out[2][i], out[3][i]}};
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
