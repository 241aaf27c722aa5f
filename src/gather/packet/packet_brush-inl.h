// Draws patches to the rasters of a packet; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_BRUSH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_BRUSH_INL_H_
#undef SURFEIT_PACKET_BRUSH_INL_H_
#else
#define SURFEIT_PACKET_BRUSH_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <type_traits>

#include "gather/packet/packet_cover-inl.h"
#include "gather/packet/packet_footprint-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/packet_rays-inl.h"
#include "gather/rules/coverage_rules.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// What begins closer than this part of its distance, measured across the face, is taken to reach
// behind the receiver.
constexpr float kLeastInFront = 1e-3f;
// Parts of how far it extends by which the box around such a thing is widened, for rounding.
constexpr float kBoxSlack = 1e-6f;

template <typename Kind>
class Brush {
 public:
  Brush(const PacketCanvas& canvas, std::size_t lane)
      : canvas_(canvas),
        lane_(lane),
        resolution_(canvas.geometry->resolution()),
        channels_(PacketCanvas::channels(*canvas.rules, canvas.is_translucent)),
        scale_(canvas.geometry->pixelsPerSlope()),
        receivers_(*canvas.lanes, lane),
        frames_(*canvas.lanes, lane) {}

  // What follows draws to this face alone.
  void BeginFace(int face) {
    face_ = face;
    face_pixels_ = canvas_.geometry->pixels().data() + face * resolution_ * resolution_;
    seen_ = &canvas_.seen->faces[std::size_t(face)];
    pixels_ = FaceLanes(canvas_.pixels, canvas_, std::size_t(face), lane_, channels_);
    recorder_ = FaceRecorder(canvas_, std::size_t(face), lane_);
    things_ = Things(pixels_, *seen_, resolution_, canvas_.is_translucent, recorder_);
    open_.Begin(*seen_);
    if constexpr (!Kind::kFrame) weights_ = FaceWeights(canvas_, receivers_, face);
    ClearFace();
  }
  // Nothing more is drawn to it.
  void EndFace() { things_.CloseAll(); }

  HWY_INLINE void DrawPatch(const Patch& patch) {
    DrawSeen(patch, See(canvas_, patch, receivers_), hn::FirstN(D(), kStep));
  }
  // In these lanes alone.
  void DrawPatch(const Patch& patch, M lanes) {
    DrawSeen(patch, See(canvas_, patch, receivers_), lanes);
  }
  // The lanes that may see some of it, as bits.
  std::uint32_t LanesThatSee(const Patch& patch) const {
    const Sight sight = See(canvas_, patch, receivers_);
    const M seen = hn::Or(sight.traced, SeenAsPatch(patch, receivers_, sight));
    return LaneBits(hn::And(seen, hn::Gt(PartsOf(canvas_, patch, lane_), hn::Zero(D()))));
  }

 private:
  HWY_INLINE void DrawSeen(const Patch& patch, Sight sight, M lanes) {
    M seen = hn::And(lanes, SeenAsPatch(patch, receivers_, sight));
    sight.traced = hn::And(lanes, sight.traced);
    if (patch.parts != 0) {
      const M counts = hn::Gt(PartsOf(canvas_, patch, lane_), hn::Zero(D()));
      seen = hn::And(seen, counts);
      sight.traced = hn::And(sight.traced, counts);
    }
    if (!hn::AllFalse(D(), sight.traced)) {
      Trace(patch, sight);
      if (recorder_) Record(CubeKind::kTraced, sight);
    }
    if (!hn::AllFalse(D(), seen)) {
      SplatPatch(patch, sight, seen);
      if (recorder_ && !patch.is_hull) Record(patch.kind, sight);
    }
  }

  void Record(CubeKind kind, const Sight& sight) const {
    const V distance = hn::Sqrt(sight.distance_sq);
    seen_->forEachPixel(std::size_t(resolution_), [&](std::size_t pixel) HWY_ATTR {
      recorder_.Look(pixel, kind, distance, pixels_.at(pixel));
    });
  }

  using Things = FaceThings<Kind::kChannels>;
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

  // What a receiver does not look at is not open. Nothing is there yet.
  void ClearFace() {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const V3 up = InRaster(receivers_.normal);
    seen_->forEachPixel(std::size_t(resolution_), [&](std::size_t pixel) HWY_ATTR {
      float* const at = pixels_.at(pixel);
      for (std::size_t i = 0; i < channels_; ++i) hn::Store(zero, d, at + i * kStep);
      const M above = hn::Gt(Dot(up, face_pixels_[pixel].direction), zero);
      const V open = hn::IfThenElseZero(hn::Or(receivers_.spherical, above), one);
      for (const std::size_t i :
           {PacketCanvas::kRoom, PacketCanvas::kOpen, PacketCanvas::kRest, Things::kRestBefore}) {
        hn::Store(open, d, at + i * kStep);
      }
      hn::Store(Splat(-kInfinity), d, at + Things::kEnd * kStep);
      hn::Store(Splat(-kInfinity), d, at + Things::kEndBefore * kStep);
      if (recorder_) recorder_.Clear(pixel, open);
    });
  }

  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  // Of this part of it.
  Cover MakeCover(const Patch& patch, const Sight& sight, V distance, V part) const {
    Cover cover;
    cover.depth_begin = hn::Sub(distance, Splat(patch.reach));
    // Rounding must not decide about equal distances, which regular scenes have
    constexpr float kRounding = 1e-5f;
    cover.depth_end = hn::MulAdd(Splat(kRounding), distance, hn::Add(distance, Splat(patch.reach)));
    cover.is_all_lit = patch.seen != Patch::Seen::kDarkBack;
    cover.is_alone = patch.is_alone;
    cover.has_hull = !patch.is_alone && !patch.has_gaps;
    cover.is_solid = patch.is_solid;
    cover.layers = TileLayersOf(patch, 1);
    cover.opacity = hn::Mul(part, hn::Mul(Splat(patch.opacity), PartsOf(canvas_, patch, lane_)));
    cover.is_lit = hn::Lt(sight.facing, hn::Zero(D()));
    cover.radiosity = patch.radiosity;
    cover.lights = patch.lights == 0 ? nullptr : canvas_.lights[patch.lights].of(lane_);
    if constexpr (Kind::kFade) cover.fade = FadeAt(*canvas_.rules, distance);
    return cover;
  }

  // Covers a parallelogram around the direction (memo 3.4.2), on every face that it reaches: the
  // image of a parallelogram that spreads as the patch does. Onto face_.
  HWY_INLINE void SplatPatch(const Patch& patch, const Sight& sight, M seen) {
    const V3 offset = AlongFace(InRaster(sight.offset), face_);
    // Numbers of lanes that see nothing must be numbers, too
    const V distance_sq = hn::IfThenElse(seen, sight.distance_sq, Splat(1));
    const V distance = hn::Mul(distance_sq, InverseSqrt(distance_sq));
    seen = hn::And(seen, hn::Gt(offset.z, hn::Mul(Splat(kFidelity.least_axis), distance)));
    if (hn::AllFalse(D(), seen)) return;

    // The visible area, times the distance
    V cosine = hn::Abs(sight.facing);
    if (patch.range > 0) {
      const V range = hn::Mul(Splat(patch.range), distance);
      cosine = patch.showsBoth() ? RimOfBoth(cosine, range) : RimCosine(sight.facing, range);
    }
    const V area = hn::Min(
        hn::MulAdd(Splat(patch.disk_area), cosine, hn::Mul(Splat(patch.round_area), distance)),
        hn::Mul(Splat(patch.most_area), distance));
    const V inverse_w = Reciprocal(hn::IfThenElse(seen, offset.z, Splat(1)));
    V part = hn::NegMulAdd(Splat(patch.filled), sight.near_part, Splat(patch.filled));
    const Parallelogram shape =
        OnFace(patch, offset, hn::IfThenElseZero(seen, area), inverse_w, part);
    DrawShape(shape, seen, MakeCover(patch, sight, distance, part), patch.is_hull);
  }

  // The shape of a patch on the plane of the face; it may lie outside the face. `offset`: along the
  // face; `area`: the visible area times the distance.
  //
  // (docs/algorithm.md, "The raster cube".) A patch with gaps is spread over its outline, and
  // covers as much less of it: times `part`.
  HWY_INLINE Parallelogram OnFace(const Patch& patch, const V3& offset, V area, V inverse,
                                  V& part) const {
    const V one = Splat(1), least = Splat(kFidelity.least_spread);
    const V3 normal = AlongFace(InRaster(patch.normal), face_);
    const V u = hn::Mul(offset.x, inverse), v = hn::Mul(offset.y, inverse);
    const V g_u = hn::NegMulAdd(u, normal.z, normal.x);
    const V g_v = hn::NegMulAdd(v, normal.z, normal.y);

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
    const V extent = hn::Min(one, hn::Mul(Splat(patch.area), inverse_sq));
    const V depth = hn::NegMulAdd(normal.z, normal.z, one);
    const V bulge = hn::MulAdd(extent, hn::Mul(Splat(0.5f), depth), one);
    V half_area =
        hn::Mul(hn::Mul(Splat(0.25f), area), hn::Mul(hn::Mul(inverse, inverse_sq), bulge));
    if (patch.is_spread) {
      const V even = EvenPart(patch, half_area, hn::Mul(row_a, c), inverse_sq);
      half_area = hn::Div(half_area, even);
      part = hn::Mul(part, even);
    }
    const V half_u_sq = hn::Max(hn::Mul(half_area, ratio), Splat(1e-30f));
    const V inverse_half_u = InverseSqrt(half_u_sq);
    const V shift = hn::Mul(extent, Splat(1.f / 3));
    const V scale = Splat(scale_), middle = Splat(0.5f * float(resolution_));
    const V middle_u = hn::MulAdd(shift, hn::MulAdd(normal.z, g_u, u), u);
    const V middle_v = hn::MulAdd(shift, hn::MulAdd(normal.z, g_v, v), v);
    return {hn::MulAdd(middle_u, scale, middle), hn::MulAdd(middle_v, scale, middle),
            hn::Mul(hn::Mul(half_u_sq, inverse_half_u), scale),
            hn::Mul(hn::Mul(half_area, inverse_half_u), scale), shear};
  }

  // Covers pixels by the part of them in the shape, and adds those in the widened one to hulls.
  HWY_INLINE void DrawShape(const Parallelogram& shape, M seen, const Cover& cover, bool is_hull) {
    const Widening widening(shape, cover.has_hull && cover.is_solid);
    const V reach = hn::MulAdd(hn::Abs(shape.shear), shape.half_y, shape.half_x);
    const FaceBox box(shape, hn::Add(reach, widening.pixels),
                      hn::Add(shape.half_y, widening.pixels), resolution_, *seen_, seen);
    if (box.range.isEmpty()) return;
    AreaRows area(shape, seen, cover.opacity, resolution_);
    HullRows hull(shape, seen, widening.pixels, box);
    for (int row = box.range.row_begin; row < box.range.row_end; ++row) {
      const bool has_area = !is_hull && area.BeginRow(row);
      if (!has_area && !cover.has_hull) continue;
      if (cover.has_hull) hull.BeginRow(row);
      const FaceWeights::Row weights(weights_, row, has_area ? area.middleY() : hn::Zero(D()));
      const auto draw = [&](std::size_t pixel, int column) HWY_ATTR __attribute__((always_inline)) {
        V amount = hn::Zero(D()), middle = amount;
        if (has_area) amount = area.Amount(column, middle);
        const VU samples = cover.has_hull ? hull.Samples(column) : hn::Zero(DU());
        const auto weight = [&]() HWY_ATTR __attribute__((always_inline)) {
          return Kind::kFrame || !has_area ? Splat(1) : weights.At(column, middle);
        };
        return DrawPixel(pixel, amount, weight, samples, widening.samples, cover,
                         [&](VU held) HWY_ATTR { return area.PartIn(held, row, column); });
      };
      open_.DrawRow(box.range, row, resolution_, draw);
    }
  }

  // False: the pixel is open to nobody.
  // `weight()`: of what covers it; `partIn(samples)`: the part that lies in these samples. Few
  // pixels need them.
  template <typename Weight, typename PartIn>
  HWY_INLINE bool DrawPixel(std::size_t at, V amount, const Weight& weight, VU samples, VU widening,
                            const Cover& cover, const PartIn& partIn) {
    const D d;
    float* const pixel = pixels_.at(at);
    const V open = hn::Load(d, pixel + PacketCanvas::kOpen * kStep);
    const M is_open = hn::Gt(open, hn::Zero(d));
    if (hn::AllFalse(d, is_open)) return false;
    amount = hn::IfThenElseZero(is_open, amount);
    const M covers = hn::Gt(amount, hn::Zero(d));
    if (!cover.is_alone) {
      samples = hn::IfThenElseZero(hn::RebindMask(DU(), is_open), samples);
      const M has_samples = hn::RebindMask(d, hn::Ne(samples, hn::Zero(DU())));
      const M meets = hn::Or(covers, has_samples);
      if (hn::AllFalse(d, meets)) return true;
      things_.Meet(at, meets, cover.depth_begin, cover.depth_end);
      if (cover.has_hull) things_.AddHull(at, samples, widening, cover.layers.count == 0);
    }
    if (hn::AllFalse(d, covers)) return true;
    V room = hn::Load(d, pixel + PacketCanvas::kRoom * kStep), least = hn::Zero(d);
    if (!cover.is_alone) {
      if (cover.layers.count > 0) least = hn::Mul(room, things_.AddTiles(at, amount, cover.layers));
      const VU held = Things::HeldOf(pixel);
      if (!hn::AllTrue(DU(), hn::Eq(held, hn::Zero(DU())))) {
        room = RoomAt(partIn(held), PartOf(held), room);
      }
    }
    CoverPixel<Kind>(pixel, amount, weight(), cover, room, least);
    return true;
  }

  // Covers the pixels whose rays hit the surfel: the near field (memo 3.4.1). Coverage of a disk
  // falls off from its middle as peak (1 - (distance / radius)^2), limited to 1.
  void Trace(const Patch& patch, const Sight& sight) {
    const V3 to_centre = RayStartTo(sight, receivers_);
    Sight from_ray = sight;
    from_ray.facing = Dot(to_centre, patch.normal);
    Cover cover = MakeCover(patch, from_ray, hn::Sqrt(sight.distance_sq), sight.near_part);
    if (!patch.isRound() && !patch.is_ribbon) {
      const float covered = softDiskArea(patch.radius, patch.soft_peak);
      cover.layers = TileLayersOf(patch, patch.disk_area / covered);
    }
    TraceBox(patch, InRaster(to_centre), InRaster(patch.normal), sight.traced, from_ray.facing,
             cover);
  }

  void TraceBox(const Patch& patch, const V3& centre, const Normal& normal, M traced, V c_n,
                const Cover& cover) {
    const D d;
    const V centre_sq = Dot(centre, centre);
    const V3 c = AlongFace(centre, face_), n = AlongFace(normal, face_);
    const V half_w = HalfSide(patch, n.z);
    traced = hn::And(traced, hn::Gt(hn::Add(c.z, half_w), hn::Zero(d)));
    if (hn::AllFalse(d, traced)) return;
    V x0, x1, y0, y1;
    Outline(patch, c.x, c.z, n.x, n.z, half_w, x0, x1);
    Outline(patch, c.y, c.z, n.y, n.z, half_w, y0, y1);
    const PixelRange range = RangeOf(traced, x0, x1, y0, y1, resolution_, *seen_);
    if (range.isEmpty()) return;

    if (patch.isRound()) {
      return TracePixels(traced, range, cover, [&](const glm::vec3& ray) HWY_ATTR {
        return SphereAmount(patch, ray, centre, centre_sq);
      });
    }
    if (patch.is_ribbon) {
      const Ribbon ribbon =
          Ribbon::ofShape(patch.shape, patch.normal, patch.area, patch.ribbon_width);
      const RibbonRays<Normal> rays(centre, c_n, normal, InRaster(ribbon.along),
                                    InRaster(ribbon.across), ribbon, 0.5f / scale_);
      return TracePixels(traced, range, cover,
                         [&](const glm::vec3& ray) HWY_ATTR { return rays.Amount(ray); });
    }
    TraceDisk(patch, centre, normal, c, n, traced, c_n, centre_sq, range, cover);
  }

  // Pixels along an axis of the face whose middles the disk may reach: of the lines across that
  // axis, at u on the face, those touch the outline that are as far from the centre as the disk
  // extends across them, (c_u - u c_w)^2 = s_uu - 2 u s_uw + u^2 s_ww with s = radius^2 (I - n
  // n^T). Of disks that reach behind the receiver those of the box around them.
  void Outline(const Patch& patch, V u, V w, V n_u, V n_w, V half_w, V& begin, V& end) const {
    const V zero = hn::Zero(D()), one = Splat(1), size = Splat(float(resolution_));
    const V half_u = HalfSide(patch, n_u);
    const float minus_sq = patch.isRound() ? 0 : -patch.radius * patch.radius;
    const V across = hn::Mul(Splat(minus_sq), hn::Mul(n_u, n_w));
    const V near = hn::Sub(w, half_w), far = hn::Add(w, half_w);
    const M in_front = hn::Gt(near, hn::Mul(Splat(kLeastInFront), far));
    const V a = hn::IfThenElse(in_front, hn::Mul(near, far), one);
    const V b = hn::MulSub(u, w, across);
    const V c = hn::NegMulAdd(half_u, half_u, hn::Mul(u, u));
    const V root = hn::Sqrt(hn::Max(zero, hn::MulSub(b, b, hn::Mul(a, c))));
    const V inverse = Reciprocal(a);
    V low = hn::Mul(hn::Sub(b, root), inverse), high = hn::Mul(hn::Add(b, root), inverse);
    if (!hn::AllTrue(D(), in_front)) {
      const V inverse_far = Reciprocal(hn::Max(far, Splat(1e-30f)));
      const V inverse_near = Reciprocal(hn::Max(near, Splat(1e-30f)));
      const V slack = hn::Mul(Splat(kBoxSlack), far);
      const V left = hn::Sub(hn::Sub(u, half_u), slack);
      const V right = hn::Add(hn::Add(u, half_u), slack);
      const V box_low =
          hn::Mul(left, hn::IfThenElse(hn::Lt(left, zero), inverse_near, inverse_far));
      const V box_high =
          hn::Mul(right, hn::IfThenElse(hn::Lt(right, zero), inverse_far, inverse_near));
      low = hn::IfThenElse(in_front, low, box_low);
      high = hn::IfThenElse(in_front, high, box_high);
    }
    // What lies there is seen from the middle of a pixel, of ribbons the parts of all; and some to
    // spare
    constexpr float kSpare = 0.02f;
    const float inset = (patch.is_ribbon ? -0.5f : 0.5f) - kSpare;
    const V scale = Splat(scale_), middle = Splat(0.5f * float(resolution_));
    begin = hn::Add(hn::MulAdd(low, scale, middle), Splat(inset));
    end = hn::Sub(hn::MulAdd(high, scale, middle), Splat(inset));
    begin = hn::Min(size, hn::Max(zero, begin));
    end = hn::Min(size, hn::Max(zero, end));
  }

  bool CoverTraced(std::size_t pixel, V amount, const Cover& cover) {
    VU samples = hn::Zero(DU());
    if (cover.has_hull) {
      const auto is_hull = hn::RebindMask(DU(), hn::Ge(amount, Splat(0.5f)));
      samples = hn::IfThenElseZero(is_hull, SplatU(kHullSamples));
    }
    const auto weight = []() HWY_ATTR { return Splat(1); };
    return DrawPixel(pixel, hn::Mul(cover.opacity, amount), weight, samples,
                     SplatU(cover.is_solid ? kHullSide / 2 : 0), cover,
                     [](VU held) HWY_ATTR { return PartOf(held); });
  }

  // Covers pixels by what amountOf(ray) says.
  template <typename AmountOf>
  void TracePixels(M traced, const PixelRange& range, const Cover& cover,
                   const AmountOf& amountOf) {
    for (int row = range.row_begin; row < range.row_end; ++row) {
      open_.DrawRow(range, row, resolution_, [&](std::size_t pixel, int) HWY_ATTR {
        const V amount = amountOf(face_pixels_[pixel].direction);
        return CoverTraced(pixel, hn::IfThenElseZero(traced, amount), cover);
      });
    }
  }

  // Most rays of the box miss the disk. With q = (u, v, 1) on the face, the ray meets the disk's
  // plane at t q with t = c.n / q.n, within the disk where |t q - c|^2 < radius^2, that is where
  //
  //   (c.n)^2 q.q - 2 c.n (q.n) (q.c) + (c.c - radius^2) (q.n)^2 < 0,
  //
  // along a row a polynomial of second degree.
  // `c` and `n`: its middle and its normal along the face.
  void TraceDisk(const Patch& patch, const V3& centre, const Normal& normal, const V3& c,
                 const V3& n, M traced, V c_n, V centre_sq, const PixelRange& range,
                 const Cover& cover) {
    const D d;
    const V minus_2 = Splat(-2);
    const V power = hn::Sub(centre_sq, Splat(patch.radius * patch.radius));
    const V plane_sq = hn::Mul(c_n, c_n);
    // Of (q.n) (power q.n - 2 c.n q.c), factor by factor
    const V m_u = hn::MulAdd(power, n.x, hn::Mul(minus_2, hn::Mul(c_n, c.x)));
    const V m_v = hn::MulAdd(power, n.y, hn::Mul(minus_2, hn::Mul(c_n, c.y)));
    const V m_w = hn::MulAdd(power, n.z, hn::Mul(minus_2, hn::Mul(c_n, c.z)));
    const V square = hn::MulAdd(n.x, m_u, plane_sq);
    const float slope = 1 / scale_, first = 0.5f * (1 - float(resolution_));
    for (int row = range.row_begin; row < range.row_end; ++row) {
      const V v = Splat(slope * (float(row) + first));
      const V n_row = hn::MulAdd(n.y, v, n.z), m_row = hn::MulAdd(m_v, v, m_w);
      const V linear = hn::MulAdd(n.x, m_row, hn::Mul(m_u, n_row));
      const V constant = hn::MulAdd(n_row, m_row, hn::Mul(plane_sq, hn::MulAdd(v, v, Splat(1))));
      open_.DrawRow(range, row, resolution_, [&](std::size_t pixel, int column) HWY_ATTR {
        const V u = Splat(slope * (float(column) + first));
        const V outside = hn::MulAdd(hn::MulAdd(square, u, linear), u, constant);
        const M hit = hn::And(traced, hn::Lt(outside, hn::Zero(d)));
        if (hn::AllFalse(d, hit)) return true;
        const glm::vec3& ray = face_pixels_[pixel].direction;
        const V amount = DiskAmount(patch, normal, ray, centre, c_n, centre_sq);
        return CoverTraced(pixel, hn::IfThenElseZero(hit, amount), cover);
      });
    }
  }

  const PacketCanvas& canvas_;
  const std::size_t lane_;
  const int resolution_;
  const std::size_t channels_;
  const float scale_;  // pixels for a slope of 1
  const Receivers receivers_;
  const Frames frames_;
  int face_ = 0;
  const RasterGeometry::Pixel* face_pixels_ = nullptr;
  const SeenPixels::Face* seen_ = nullptr;
  FaceLanes pixels_;  // of the face
  OpenPixels open_;
  FaceWeights weights_;
  FaceRecorder recorder_;
  Things things_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
