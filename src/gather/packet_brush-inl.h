// Draws patches to the rasters of a packet; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_BRUSH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_BRUSH_INL_H_
#undef SURFEIT_PACKET_BRUSH_INL_H_
#else
#define SURFEIT_PACKET_BRUSH_INL_H_
#endif

#include <hwy/highway.h>
// Needs the instruction set that the former chose
#include <hwy/contrib/math/math-inl.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <type_traits>

#include "gather/coverage_rules.h"
#include "gather/packet_kernel.h"
#include "gather/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// How some of the receivers' pixels are covered.
struct Cover {
  V depth_begin, depth_end;
  M is_lit;
  bool is_all_lit;
  float overlap;
  glm::vec3 radiosity;
  V fade;  // only when something fades
};

// What a kernel for one kind of raster draws.
template <bool kHasColor, bool kHasFade, bool kHasFrame>
struct BrushKind {
  static constexpr bool kColor = kHasColor, kFade = kHasFade;
  static constexpr bool kFrame = kHasFrame;  // the raster of a cone, in a frame of each lane
  static constexpr std::size_t kChannels = (kColor ? 3 : 0) + (kFade ? 1 : 0);
};

// As RasterCube::coverPixel, where `amount` is positive.
template <typename Kind>
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
  const V slope = hn::NegMulAdd(middle, Splat(cover.overlap), one);
  const V layer = hn::Min(one, hn::MulAdd(amount, slope, before));
  hn::Store(layer, d, layer_at);
  if constexpr (Kind::kChannels > 0) {
    V added = hn::Mul(room, hn::Sub(layer, before));
    float* at = pixel + PacketCanvas::kCoverageChannels * kPacketReceivers;
    if constexpr (Kind::kFade) {
      float* const fade_at = at + (Kind::kChannels - 1) * kPacketReceivers;
      hn::Store(hn::MulAdd(added, cover.fade, hn::Load(d, fade_at)), d, fade_at);
    }
    if constexpr (Kind::kColor) {
      if (!cover.is_all_lit) added = hn::IfThenElseZero(cover.is_lit, added);
      for (int c = 0; c < 3; ++c) {
        hn::Store(hn::MulAdd(added, Splat(cover.radiosity[c]), hn::Load(d, at)), d, at);
        at += kPacketReceivers;
      }
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

template <typename Kind>
class Brush {
 public:
  Brush(const PacketCanvas& canvas, std::size_t lane)
      : canvas_(canvas),
        lane_(lane),
        resolution_(canvas.geometry->resolution()),
        scale_(canvas.geometry->pixelsPerSlope()),
        receivers_(*canvas.lanes, lane),
        frames_(*canvas.lanes, lane) {}

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
  static constexpr std::size_t kPixelFloats =
      (PacketCanvas::kCoverageChannels + Kind::kChannels) * kPacketReceivers;
  // Of a patch, in the frame of the raster.
  using Normal = std::conditional_t<Kind::kFrame, V3, glm::vec3>;
  Normal InRaster(const glm::vec3& normal) const {
    if constexpr (Kind::kFrame) {
      return frames_.ToLocal(normal);
    } else {
      return normal;
    }
  }
  V3 InRaster(const V3& v) const {
    if constexpr (Kind::kFrame) {
      return frames_.ToLocal(v);
    } else {
      return v;
    }
  }

  // Entries of a shape in the frame of the raster, w towards the face that is drawn.
  struct FaceShape {
    V uu, vv, ww, uv, uw, vw;
  };
  FaceShape InRaster(const SymmetricMatrix& m) const {
    const int w_axis = face_ / 2, u_axis = (w_axis + 1) % 3, v_axis = (w_axis + 2) % 3;
    if constexpr (Kind::kFrame) {
      const V3 mx = frames_.Times(m, 0), my = frames_.Times(m, 1), mz = frames_.Times(m, 2);
      // The raster of a cone has the face +x alone
      return {Dot(frames_.y, my), Dot(frames_.z, mz), Dot(frames_.x, mx),
              Dot(frames_.y, mz), Dot(frames_.x, my), Dot(frames_.x, mz)};
    } else {
      const float sign = face_ % 2 == 0 ? 1.f : -1.f;
      return {Splat(m(u_axis, u_axis)),        Splat(m(v_axis, v_axis)),
              Splat(m(w_axis, w_axis)),        Splat(m(u_axis, v_axis)),
              Splat(sign * m(u_axis, w_axis)), Splat(sign * m(v_axis, w_axis))};
    }
  }

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
    const V reach = Splat(patch.reach);
    Cover cover;
    cover.depth_begin = hn::Sub(distance, reach);
    cover.depth_end = hn::Add(distance, reach);
    cover.is_all_lit = patch.facing_limit != Patch::kDarkBack;
    cover.overlap = patch.overlap;
    cover.is_lit = hn::Lt(sight.facing, hn::Zero(D()));
    cover.radiosity = patch.radiosity;
    if constexpr (Kind::kFade) cover.fade = FadeAt(distance);
    return cover;
  }

  // As fadeAt.
  V FadeAt(V distance) const {
    const D d;
    const GatherWeights& weights = canvas_.rules->weights;
    if (weights.falloff_mode == GatherWeights::FalloffMode::kExponential) {
      return hn::Exp(d, hn::Mul(Splat(-weights.falloff), distance));
    }
    const float inverse = 1 / canvas_.rules->quality.max_distance;
    const V rest = hn::NegMulAdd(distance, Splat(inverse), Splat(1));
    const V power = hn::Mul(Splat(weights.falloff), hn::Log(d, hn::Max(rest, Splat(1e-30f))));
    return hn::IfThenElseZero(hn::Gt(rest, Splat(1e-30f)), hn::Exp(d, power));
  }

  // As RasterCube::splat, onto face_.
  HWY_INLINE void SplatPatch(const Patch& patch, const Sight& sight, M seen) {
    const V3 offset = InRaster(sight.offset);
    const V w = hn::Mul(Splat(face_ % 2 == 0 ? 1.f : -1.f), Axis(offset, face_ / 2));
    const V inverse = InverseSqrt(sight.distance_sq);
    const V distance = hn::Mul(sight.distance_sq, inverse);
    seen = hn::And(seen, hn::Gt(w, hn::Mul(Splat(kLeastAxis), distance)));
    if (hn::AllFalse(D(), seen)) return;

    // The visible area, times the distance
    const V cosine = patch.range > 0
                         ? RimCosine(sight.facing, hn::Mul(Splat(patch.range), distance))
                         : hn::Abs(sight.facing);
    const V area = hn::Min(
        hn::MulAdd(Splat(patch.disk_area), cosine, hn::Mul(Splat(patch.round_area), distance)),
        hn::Mul(Splat(patch.most_area), distance));
    // Numbers of lanes that see nothing must be numbers, too
    const V inverse_w = Reciprocal(hn::IfThenElse(seen, w, Splat(1)));
    CoverParallelogram(OnFace(patch, offset, hn::IfThenElseZero(seen, area), inverse_w), seen,
                       MakeCover(patch, sight, distance));
  }

  // As facingAreas of a facet; all times the distance.
  static V RimCosine(V facing, V range) {
    const V sum = hn::Max(hn::Zero(D()), hn::Sub(range, facing));
    const V rim = hn::Div(hn::Mul(sum, sum), hn::Mul(Splat(4), range));
    return hn::IfThenElse(hn::Lt(hn::Neg(facing), range), rim, hn::Neg(facing));
  }

  // As RasterCube::onFace; `area` is the visible area times the distance.
  HWY_INLINE Parallelogram OnFace(const Patch& patch, const V3& offset, V area, V inverse) const {
    const V one = Splat(1), least = Splat(kLeastSpread);
    const int axis = face_ / 2, u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
    const Normal normal = InRaster(patch.normal);
    const V u = hn::Mul(Axis(offset, u_axis), inverse);
    const V v = hn::Mul(Axis(offset, v_axis), inverse);
    const V n_axis = hn::Mul(Splat(face_ % 2 == 0 ? 1.f : -1.f), Axis(normal, axis));
    const V g_u = hn::NegMulAdd(u, n_axis, Axis(normal, u_axis));
    const V g_v = hn::NegMulAdd(v, n_axis, Axis(normal, v_axis));

    // The spread on the face, and what is left of a row's when it is sheared
    const FaceShape m = InRaster(patch.shape);
    const V wu = hn::NegMulAdd(u, m.ww, m.uw), wv = hn::NegMulAdd(v, m.ww, m.vw);
    const V a = hn::Max(least, hn::NegMulAdd(u, hn::Add(m.uw, wu), m.uu));
    const V c = hn::Max(least, hn::NegMulAdd(v, hn::Add(m.vw, wv), m.vv));
    const V b = hn::NegMulAdd(v, wu, hn::NegMulAdd(u, m.vw, m.uv));
    const V inverse_c = Reciprocal(c);
    const V shear = hn::Mul(b, inverse_c);
    const V row_a = hn::Max(hn::Mul(least, a), hn::NegMulAdd(b, shear, a));
    const V ratio_sq = hn::Mul(row_a, inverse_c);
    const V ratio = hn::Mul(ratio_sq, InverseSqrt(ratio_sq));

    // Area on the face: du dv = area / distance^2 * (distance / w)^3, and more for large ones
    const V inverse_sq = hn::Mul(inverse, inverse);
    const V extent = hn::Min(Splat(kMostExtent), hn::Mul(Splat(patch.area), inverse_sq));
    const V depth = hn::NegMulAdd(n_axis, n_axis, one);
    const V bulge = hn::MulAdd(extent, hn::Mul(Splat(0.5f), depth), one);
    const V half_area =
        hn::Mul(hn::Mul(Splat(0.25f), area), hn::Mul(hn::Mul(inverse, inverse_sq), bulge));
    const V half_u_sq = hn::Max(hn::Mul(half_area, ratio), Splat(1e-30f));
    const V inverse_half_u = InverseSqrt(half_u_sq);
    const V shift = hn::Mul(extent, Splat(1.f / 3));
    const V scale = Splat(scale_), middle = Splat(0.5f * float(resolution_));
    const V middle_u = hn::MulAdd(shift, hn::MulAdd(n_axis, g_u, u), u);
    const V middle_v = hn::MulAdd(shift, hn::MulAdd(n_axis, g_v, v), v);
    return {hn::MulAdd(middle_u, scale, middle), hn::MulAdd(middle_v, scale, middle),
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
        CoverPixel<Kind>(pixel, hn::Mul(width, height), cover);
        pixel += kPixelFloats;
      }
    }
  }

  // As RasterCube::traceDisk and traceSphere.
  void Trace(const Patch& patch, const Sight& sight) {
    const V3 to_centre = {hn::NegMulAdd(sight.bias, receivers_.normal.x, sight.offset.x),
                          hn::NegMulAdd(sight.bias, receivers_.normal.y, sight.offset.y),
                          hn::NegMulAdd(sight.bias, receivers_.normal.z, sight.offset.z)};
    Sight from_ray = sight;
    from_ray.facing = Dot(to_centre, patch.normal);
    TraceBox(patch, InRaster(to_centre), InRaster(patch.normal), sight.traced, from_ray.facing,
             MakeCover(patch, from_ray, hn::Sqrt(sight.distance_sq)));
  }

  // Half of the side along an axis of the box around the disk.
  static V HalfSide(const Patch& patch, const V3& normal, int axis) {
    if (patch.isRound()) return Splat(patch.radius);
    const V n = Axis(normal, axis);
    return hn::Mul(Splat(patch.radius),
                   hn::Sqrt(hn::Max(hn::Zero(D()), hn::NegMulAdd(n, n, Splat(1)))));
  }
  static V HalfSide(const Patch& patch, const glm::vec3& normal, int axis) {
    if (patch.isRound()) return Splat(patch.radius);
    return Splat(patch.radius * std::sqrt(std::max(0.f, 1 - normal[axis] * normal[axis])));
  }

  void TraceBox(const Patch& patch, const V3& centre, const Normal& normal, M traced, V c_n,
                const Cover& cover) {
    const D d;
    const int axis = face_ / 2, u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
    const V centre_sq = Dot(centre, centre);
    const V w = hn::Mul(Splat(face_ % 2 == 0 ? 1.f : -1.f), Axis(centre, axis));
    const V half_w = HalfSide(patch, normal, axis);
    const V w_far = hn::Add(w, half_w);
    traced = hn::And(traced, hn::Gt(w_far, hn::Zero(d)));
    if (hn::AllFalse(d, traced)) return;

    // Pixels that see the box; what lies behind the face's origin reaches everywhere
    const V inverse_far = Reciprocal(w_far);
    const V inverse_near = Reciprocal(hn::Max(hn::Sub(w, half_w), hn::Mul(w_far, Splat(1e-3f))));
    V x0, x1, y0, y1;
    Slopes(Axis(centre, u_axis), HalfSide(patch, normal, u_axis), inverse_near, inverse_far, x0,
           x1);
    Slopes(Axis(centre, v_axis), HalfSide(patch, normal, v_axis), inverse_near, inverse_far, y0,
           y1);
    const PixelRange range = RangeOf(traced, x0, x1, y0, y1, resolution_);
    if (range.isEmpty()) return;

    const std::size_t face_first = std::size_t(face_ * resolution_ * resolution_);
    for (int row = range.row_begin; row < range.row_end; ++row) {
      for (int column = range.column_begin; column < range.column_end; ++column) {
        const std::size_t in_face = std::size_t(row * resolution_ + column);
        const glm::vec3& ray = canvas_.geometry->pixels()[face_first + in_face].direction;
        const V amount = hn::IfThenElseZero(
            traced, patch.isRound() ? SphereAmount(patch, ray, centre, centre_sq)
                                    : DiskAmount(patch, normal, ray, centre, c_n, centre_sq));
        if (hn::AllFalse(d, hn::Gt(amount, hn::Zero(d)))) continue;
        CoverPixel<Kind>(pixels_ + in_face * kPixelFloats, amount, cover);
      }
    }
  }

  // Pixel coordinates between which directions to [x - half, x + half] lie, one to spare.
  void Slopes(V x, V half, V inverse_near, V inverse_far, V& begin, V& end) const {
    const V zero = hn::Zero(D()), size = Splat(float(resolution_));
    const V scale = Splat(scale_), middle = Splat(0.5f * float(resolution_));
    const V low = hn::Sub(x, half), high = hn::Add(x, half);
    const V slope_low = hn::Mul(low, hn::IfThenElse(hn::Lt(low, zero), inverse_near, inverse_far));
    const V slope_high =
        hn::Mul(high, hn::IfThenElse(hn::Lt(high, zero), inverse_far, inverse_near));
    const V spare = Splat(0.01f);
    begin = hn::Min(size, hn::Max(zero, hn::Sub(hn::MulAdd(slope_low, scale, middle), spare)));
    end = hn::Min(size, hn::Max(zero, hn::Add(hn::MulAdd(slope_high, scale, middle), spare)));
  }

  static V SphereAmount(const Patch& patch, const glm::vec3& ray, const V3& centre, V centre_sq) {
    const V along = Dot(centre, ray);
    const V power = hn::Sub(centre_sq, Splat(patch.radius * patch.radius));
    const M hit = hn::And(hn::Gt(along, hn::Zero(D())), hn::Ge(hn::Mul(along, along), power));
    return hn::IfThenElseZero(hit, Splat(1));
  }

  // How much of the ray's pixel the soft disk covers; zero or less where the ray misses it.
  static V DiskAmount(const Patch& patch, const Normal& normal, const glm::vec3& ray,
                      const V3& centre, V c_n, V centre_sq) {
    V t;
    if constexpr (Kind::kFrame) {
      const V d_n = Dot(normal, ray);
      t = hn::Div(c_n, hn::IfThenElse(hn::Eq(d_n, hn::Zero(D())), Splat(1e-20f), d_n));
    } else {
      const float d_n = glm::dot(ray, normal);
      t = hn::Mul(c_n, Splat(1 / (d_n != 0 ? d_n : 1e-20f)));
    }
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
  const float scale_;  // pixels for a slope of 1
  const Receivers receivers_;
  const Frames frames_;
  int face_ = 0;
  float* pixels_ = nullptr;  // of the face, from the first of our lanes
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
