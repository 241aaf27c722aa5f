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

inline Sight See(const PacketCanvas& canvas, const Patch& patch, const Receivers& receivers) {
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

  if (patch.kind == PatchKind::kRound) {
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
  if (patch.kind == PatchKind::kFront) {
    sight.traced =
        hn::And(sight.traced, hn::Lt(hn::NegMulAdd(sight.bias, cosine, sight.facing), zero));
  } else if (patch.kind == PatchKind::kRound) {
    const V along =
        hn::MulAdd(sight.bias, sight.bias,
                   hn::NegMulAdd(hn::Mul(Splat(2), sight.bias), sight.height, sight.distance_sq));
    sight.traced = hn::And(sight.traced, hn::Gt(along, Splat(patch.radius * patch.radius)));
  }
  return sight;
}

// Lanes to which the patch is a patch of solid angle: the mid or the far field.
inline M SeenAsPatch(const Patch& patch, const Receivers& receivers, const Sight& sight) {
  const V zero = hn::Zero(D());
  const M above = hn::Or(receivers.spherical, hn::Gt(sight.height, zero));
  M seen = hn::And(hn::AndNot(sight.is_near, sight.in_reach), above);
  if (patch.kind == PatchKind::kFront) seen = hn::And(seen, hn::Lt(sight.facing, zero));
  return seen;
}

HWY_ATTR bool IsSeen(const PacketCanvas& canvas, const Patch& patch) {
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    const Receivers receivers(*canvas.lanes, lane);
    const Sight sight = See(canvas, patch, receivers);
    if (!hn::AllFalse(D(), hn::Or(sight.traced, SeenAsPatch(patch, receivers, sight)))) return true;
  }
  return false;
}

// How some of the receivers' pixels are covered.
struct Cover {
  V depth_begin, depth_end;
  M is_lit;
  bool is_all_lit;
  glm::vec3 radiosity;
};

inline V Filled(V layer) {
  const V cubed = hn::Mul(hn::Mul(layer, layer), layer);
  return hn::Min(Splat(1), hn::MulAdd(Splat(kFill), cubed, layer));
}

// As RasterCube::coverPixel, where `amount` is positive.
template <bool kColor>
inline void CoverPixel(float* pixel, V amount, const Cover& cover) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  float* const room_at = pixel;
  float* const layer_at = pixel + kPacketReceivers;
  float* const end_at = pixel + 2 * kPacketReceivers;
  const V end = hn::Load(d, end_at);
  V room = hn::Load(d, room_at), layer = hn::Load(d, layer_at);
  V filled = Filled(layer);

  // A gap in depth begins a new layer
  const M touched = hn::Gt(amount, zero);
  const M is_new = hn::And(touched, hn::Gt(cover.depth_begin, end));
  room = hn::IfThenElse(is_new, hn::NegMulAdd(room, filled, room), room);
  layer = hn::IfThenZeroElse(is_new, layer);
  filled = hn::IfThenZeroElse(is_new, filled);
  hn::Store(room, d, room_at);
  hn::Store(hn::IfThenElse(touched, hn::Max(end, cover.depth_end), end), d, end_at);

  layer = hn::Min(hn::Add(layer, amount), one);
  hn::Store(layer, d, layer_at);
  if constexpr (kColor) {
    V added = hn::Mul(room, hn::Sub(Filled(layer), filled));
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

// On a face, in its coordinates.
struct Rectangle {
  V u_begin, u_end, v_begin, v_end;
};

template <bool kColor>
class Brush {
 public:
  Brush(const PacketCanvas& canvas, std::size_t lane)
      : canvas_(canvas),
        lane_(lane),
        resolution_(canvas.geometry->resolution()),
        receivers_(*canvas.lanes, lane) {}

  void DrawPatch(const Patch& patch) {
    const Sight sight = See(canvas_, patch, receivers_);
    if (!hn::AllFalse(D(), sight.traced)) Trace(patch, sight);
    const M seen = SeenAsPatch(patch, receivers_, sight);
    if (!hn::AllFalse(D(), seen)) SplatPatch(patch, sight, seen);
  }

 private:
  static constexpr std::size_t kPixelFloats = PacketCanvas::pixelFloats(kColor);

  float* Face(int face) {
    if (!(*canvas_.is_face_used)[std::size_t(face)]) ClearFace(face);
    const std::size_t face_pixels = std::size_t(resolution_ * resolution_);
    return canvas_.pixels + std::size_t(face) * face_pixels * kPixelFloats + lane_;
  }

  // For all lanes.
  void ClearFace(int face) {
    const D d;
    const std::size_t face_pixels = std::size_t(resolution_ * resolution_);
    float* at = canvas_.pixels + std::size_t(face) * face_pixels * kPixelFloats;
    for (std::size_t i = 0; i < face_pixels; ++i) {
      for (std::size_t lane = 0; lane < kPixelFloats; lane += kStep) {
        hn::Store(Splat(lane < kPacketReceivers ? 1.f : 0.f), d, at + lane);
      }
      at += kPixelFloats;
    }
    (*canvas_.is_face_used)[std::size_t(face)] = true;
  }

  Cover MakeCover(const Patch& patch, const Sight& sight, V distance) const {
    const V reach = Splat(kLayerReach * patch.radius);
    Cover cover;
    cover.depth_begin = hn::Sub(distance, reach);
    cover.depth_end = hn::Add(distance, reach);
    cover.is_all_lit = patch.kind != PatchKind::kDarkBack;
    cover.is_lit = hn::Lt(sight.facing, hn::Zero(D()));
    cover.radiosity = patch.radiosity;
    return cover;
  }

  // As RasterCube::splatRectangle.
  void SplatPatch(const Patch& patch, const Sight& sight, M seen) {
    const D d;
    const V zero = hn::Zero(d);
    const V inverse = InverseSqrt(sight.distance_sq);
    const V3 direction = {hn::Mul(sight.offset.x, inverse), hn::Mul(sight.offset.y, inverse),
                          hn::Mul(sight.offset.z, inverse)};
    V area = Splat(patch.area);
    if (patch.kind != PatchKind::kRound) {
      area = hn::Mul(area, hn::Abs(hn::Mul(sight.facing, inverse)));
    }
    area = hn::Min(area, Splat(patch.most_area));
    const V solid_angle = hn::Mul(area, hn::Mul(inverse, inverse));
    seen = hn::And(seen, hn::Gt(solid_angle, zero));
    if (hn::AllFalse(d, seen)) return;
    const Cover cover = MakeCover(patch, sight, hn::Mul(sight.distance_sq, inverse));

    // Lanes share a face but where the direction is close to an edge
    const V3 size = {hn::Abs(direction.x), hn::Abs(direction.y), hn::Abs(direction.z)};
    const M x_over_y = hn::Ge(size.x, size.y);
    const M on_z = hn::Gt(size.z, hn::Max(size.x, size.y));
    const std::array<M, 3> on_axis = {hn::AndNot(on_z, x_over_y),
                                      hn::AndNot(hn::Or(on_z, x_over_y), seen), on_z};
    for (int axis = 0; axis < 3; ++axis) {
      const M on = hn::And(seen, on_axis[std::size_t(axis)]);
      if (hn::AllFalse(d, on)) continue;
      const M negative = hn::Lt(Axis(direction, axis), zero);
      const M on_front = hn::AndNot(negative, on), on_back = hn::And(negative, on);
      if (!hn::AllFalse(d, on_front)) {
        SplatOnFace(axis, 1, direction, patch.normal, solid_angle, on_front, cover);
      }
      if (!hn::AllFalse(d, on_back)) {
        SplatOnFace(axis, -1, direction, patch.normal, solid_angle, on_back, cover);
      }
    }
  }

  void SplatOnFace(int axis, float sign, const V3& direction, const glm::vec3& normal,
                   V solid_angle, M seen, const Cover& cover) {
    const D d;
    const V one = Splat(1);
    const int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
    const V inverse = Reciprocal(hn::Mul(Splat(sign), Axis(direction, axis)));
    const V u = hn::Mul(Axis(direction, u_axis), inverse);
    const V v = hn::Mul(Axis(direction, v_axis), inverse);

    // The sides are in the ratio of the extents of a disk with this normal
    const V n_axis = Splat(sign * normal[axis]), least = Splat(kLeastExtentSq);
    const V g_u = hn::NegMulAdd(u, n_axis, Splat(normal[u_axis]));
    const V g_v = hn::NegMulAdd(v, n_axis, Splat(normal[v_axis]));
    const V extent_u = hn::Max(least, hn::NegMulAdd(g_u, g_u, hn::MulAdd(u, u, one)));
    const V extent_v = hn::Max(least, hn::NegMulAdd(g_v, g_v, hn::MulAdd(v, v, one)));
    const V ratio = hn::Mul(extent_u, InverseSqrt(hn::Mul(extent_u, extent_v)));
    const V half_area =
        hn::Mul(hn::Mul(Splat(0.25f), solid_angle), hn::Mul(inverse, hn::Mul(inverse, inverse)));
    const V half_u_sq = hn::Mul(half_area, ratio);
    const V inverse_half_u = InverseSqrt(half_u_sq);
    const V half_u = hn::Mul(half_u_sq, inverse_half_u);
    const V half_v = hn::Mul(half_area, inverse_half_u);
    const Rectangle on_face = {hn::Sub(u, half_u), hn::Add(u, half_u), hn::Sub(v, half_v),
                               hn::Add(v, half_v)};
    CoverRectangle(2 * axis + (sign < 0 ? 1 : 0), on_face, seen, cover);

    const V farthest = hn::Max(hn::Max(on_face.u_end, hn::Neg(on_face.u_begin)),
                               hn::Max(on_face.v_end, hn::Neg(on_face.v_begin)));
    const M spills = hn::And(seen, hn::Gt(farthest, one));
    if (!hn::AllFalse(d, spills)) SpillOver(axis, sign, on_face, spills, cover);
  }

  // To the neighbours of a face.
  void SpillOver(int axis, float sign, const Rectangle& on_face, M seen, const Cover& cover) {
    const D d;
    const V one = Splat(1);
    const int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
    for (const int side : {0, 1}) {
      const V v_far = side == 0 ? on_face.v_end : hn::Neg(on_face.v_begin);
      const M over_v = hn::And(seen, hn::Gt(v_far, one));
      if (!hn::AllFalse(d, over_v)) {
        const V depth = Reciprocal(v_far), shrink = Shrink(v_far);
        CoverRectangle(2 * v_axis + side,
                       {sign > 0 ? depth : Splat(-1), sign > 0 ? one : hn::Neg(depth),
                        hn::Mul(on_face.u_begin, shrink), hn::Mul(on_face.u_end, shrink)},
                       over_v, cover);
      }
      const V u_far = side == 0 ? on_face.u_end : hn::Neg(on_face.u_begin);
      const M over_u = hn::And(seen, hn::Gt(u_far, one));
      if (!hn::AllFalse(d, over_u)) {
        const V depth = Reciprocal(u_far), shrink = Shrink(u_far);
        CoverRectangle(2 * u_axis + side,
                       {hn::Mul(on_face.v_begin, shrink), hn::Mul(on_face.v_end, shrink),
                        sign > 0 ? depth : Splat(-1), sign > 0 ? one : hn::Neg(depth)},
                       over_u, cover);
      }
    }
  }
  static V Shrink(V far) { return hn::Mul(Splat(2), Reciprocal(hn::Add(Splat(1), far))); }

  // Covers the pixels of a face by the part of them that lies in the rectangle.
  void CoverRectangle(int face, const Rectangle& rectangle, M seen, const Cover& cover) {
    const D d;
    const V zero = hn::Zero(d);
    const V size = Splat(float(resolution_)), scale = Splat(0.5f * float(resolution_));
    const V x0 = hn::Max(zero, hn::MulAdd(rectangle.u_begin, scale, scale));
    const V x1 = hn::Min(size, hn::MulAdd(rectangle.u_end, scale, scale));
    const V y0 = hn::Max(zero, hn::MulAdd(rectangle.v_begin, scale, scale));
    const V y1 = hn::Min(size, hn::MulAdd(rectangle.v_end, scale, scale));
    seen = hn::And(seen, hn::And(hn::Lt(x0, x1), hn::Lt(y0, y1)));
    if (hn::AllFalse(d, seen)) return;
    CoverPixels(face, seen, x0, hn::IfThenElseZero(seen, x1), y0, y1, cover);
  }

  // Lanes outside of `seen` have x1 = 0, and with it no width.
  void CoverPixels(int face, M seen, V x0, V x1, V y0, V y1, const Cover& cover) {
    const V zero = hn::Zero(D());
    const PixelRange range = RangeOf(seen, x0, x1, y0, y1, resolution_);
    if (range.isEmpty()) return;
    float* const pixels = Face(face);
    for (int row = range.row_begin; row < range.row_end; ++row) {
      const V height = hn::Max(
          zero, hn::Sub(hn::Min(y1, Splat(float(row + 1))), hn::Max(y0, Splat(float(row)))));
      float* pixel = pixels + std::size_t(row * resolution_ + range.column_begin) * kPixelFloats;
      for (int column = range.column_begin; column < range.column_end; ++column) {
        const V width = hn::Max(zero, hn::Sub(hn::Min(x1, Splat(float(column + 1))),
                                              hn::Max(x0, Splat(float(column)))));
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
    const V power = hn::Sub(Dot(centre, centre), Splat(patch.radius * patch.radius));
    const bool is_sphere = patch.kind == PatchKind::kRound;
    // Half the sides of the box around the disk
    const glm::vec3 normal = patch.normal;
    const glm::vec3 half =
        patch.radius *
        (is_sphere ? glm::vec3(1) : glm::sqrt(glm::max(glm::vec3(0), 1.f - normal * normal)));
    for (int face = 0; face < RasterGeometry::kFaces; ++face) {
      TraceOnFace(face, centre, half, sight.traced, is_sphere, normal, from_ray.facing, power,
                  cover);
    }
  }

  void TraceOnFace(int face, const V3& centre, const glm::vec3& half, M traced, bool is_sphere,
                   const glm::vec3& normal, V c_n, V power, const Cover& cover) {
    const D d;
    const int axis = face / 2;
    const V w = hn::Mul(Splat(face % 2 == 0 ? 1.f : -1.f), Axis(centre, axis));
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

    float* const pixels = Face(face);
    const std::size_t face_first = std::size_t(face * resolution_ * resolution_);
    for (int row = range.row_begin; row < range.row_end; ++row) {
      for (int column = range.column_begin; column < range.column_end; ++column) {
        const std::size_t in_face = std::size_t(row * resolution_ + column);
        const glm::vec3& ray = canvas_.geometry->pixels()[face_first + in_face].direction;
        const M hit = hn::And(traced, IsHit(ray, centre, is_sphere, normal, c_n, power));
        if (hn::AllFalse(d, hit)) continue;
        CoverPixel<kColor>(pixels + in_face * kPixelFloats, hn::IfThenElseZero(hit, Splat(1)),
                           cover);
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

  static M IsHit(const glm::vec3& ray, const V3& centre, bool is_sphere, const glm::vec3& normal,
                 V c_n, V power) {
    const V zero = hn::Zero(D());
    const V along = Dot(centre, ray);
    if (is_sphere) return hn::And(hn::Gt(along, zero), hn::Ge(hn::Mul(along, along), power));
    const float d_n = glm::dot(ray, normal);
    const V n = Splat(d_n);
    const V inside = hn::MulAdd(hn::Mul(power, n), n,
                                hn::Mul(c_n, hn::NegMulAdd(hn::Mul(Splat(2), n), along, c_n)));
    return hn::And(hn::Gt(hn::Mul(c_n, n), zero), hn::Le(inside, zero));
  }

  const PacketCanvas& canvas_;
  const std::size_t lane_;
  const int resolution_;
  const Receivers receivers_;
};

template <bool kColor>
void DrawAll(const PacketCanvas& canvas, const Patch* patches,
             std::span<const std::uint64_t> order) {
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    Brush<kColor> brush(canvas, lane);
    for (const std::uint64_t key : order) brush.DrawPatch(patches[std::uint32_t(key)]);
  }
}

void Draw(const PacketCanvas& canvas, const Patch* patches, std::span<const std::uint64_t> order) {
  canvas.has_color ? DrawAll<true>(canvas, patches, order) : DrawAll<false>(canvas, patches, order);
}

// As ReceiverRaster::integrate.
void Integrate(const PacketCanvas& canvas, std::span<GatherResult> results) {
  const D d;
  const std::span<const RasterGeometry::Pixel> pixels = canvas.geometry->pixels();
  const std::size_t face_pixels = pixels.size() / RasterGeometry::kFaces;
  const std::size_t pixel_floats = PacketCanvas::pixelFloats(canvas.has_color);
  const V one = Splat(1);
  alignas(64) std::array<std::array<float, kPacketReceivers>, 4> out;
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    const Receivers receivers(*canvas.lanes, lane);
    const V spherical = hn::IfThenElseZero(receivers.spherical, one);
    V weight_sum = hn::Zero(d), covered = weight_sum;
    V red = weight_sum, green = weight_sum, blue = weight_sum;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const V cosine = hn::Max(spherical, Dot(receivers.normal, pixels[i].direction));
      const V weight = hn::Mul(cosine, Splat(pixels[i].solid_angle));
      weight_sum = hn::Add(weight_sum, weight);
      if (!(*canvas.is_face_used)[i / face_pixels]) continue;
      const float* const pixel = canvas.pixels + i * pixel_floats + lane;
      const V room = hn::Load(d, pixel), layer = hn::Load(d, pixel + kPacketReceivers);
      const V total = hn::Sub(one, hn::NegMulAdd(room, Filled(layer), room));
      covered = hn::MulAdd(weight, total, covered);
      if (!canvas.has_color) continue;
      red = hn::MulAdd(weight, hn::Load(d, pixel + 3 * kPacketReceivers), red);
      green = hn::MulAdd(weight, hn::Load(d, pixel + 4 * kPacketReceivers), green);
      blue = hn::MulAdd(weight, hn::Load(d, pixel + 5 * kPacketReceivers), blue);
    }
    const V inverse = hn::Div(one, weight_sum);
    hn::Store(hn::Mul(covered, inverse), d, out[0].data() + lane);
    hn::Store(hn::Mul(red, inverse), d, out[1].data() + lane);
    hn::Store(hn::Mul(green, inverse), d, out[2].data() + lane);
    hn::Store(hn::Mul(blue, inverse), d, out[3].data() + lane);
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
