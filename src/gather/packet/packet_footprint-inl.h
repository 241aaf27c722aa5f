// Where in its pixels a patch lies: what that weighs, and the samples that it adds, widened, to the
// hulls of a packet's rasters; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_FOOTPRINT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_FOOTPRINT_INL_H_
#undef SURFEIT_PACKET_FOOTPRINT_INL_H_
#else
#define SURFEIT_PACKET_FOOTPRINT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "gather/packet/packet_cover-inl.h"
#include "gather/packet/packet_hull-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/rules/coverage_rules.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// On a face, in pixels: rows of width 2 half_x around the line x + shear (row - y).
struct Parallelogram {
  V x, y, half_x, half_y, shear;
};

// The part on the face of a box around the middle of a shape, and the pixels that it reaches.
struct FaceBox {
  V x0, x1, y0, y1;
  PixelRange range{};

  // `seen`: lanes that count; of these remain those that see some of it.
  HWY_INLINE FaceBox(const Parallelogram& shape, V half_x, V half_y, int resolution,
                     const SeenPixels::Face& face, M& seen) {
    const V zero = hn::Zero(D()), size = Splat(float(resolution));
    x0 = hn::Max(zero, hn::Sub(shape.x, half_x));
    x1 = hn::Min(size, hn::Add(shape.x, half_x));
    y0 = hn::Max(zero, hn::Sub(shape.y, half_y));
    y1 = hn::Min(size, hn::Add(shape.y, half_y));
    seen = hn::And(seen, hn::And(hn::Lt(x0, x1), hn::Lt(y0, y1)));
    if (!hn::AllFalse(D(), seen)) range = RangeOf(seen, x0, x1, y0, y1, resolution, face);
  }
};

// What places on a face weigh, their cosine and solid angle for their area there, over what the
// middles of their pixels weigh; 1 unless directions weigh by the plain cosine. With q = (u, v, 1),
// the cosine over du dv / solid angle is q.n / |q| / |q|^3.
class FaceWeights {
 public:
  FaceWeights() = default;
  FaceWeights(const PacketCanvas& canvas, const Receivers& receivers, int face)
      : weighs_(canvas.weights->isPlainCosine()),
        is_any_spherical_(!hn::AllFalse(D(), receivers.spherical)),
        spherical_(receivers.spherical),
        slope_(1 / canvas.geometry->pixelsPerSlope()),
        middle_(0.5f * float(canvas.geometry->resolution())),
        up_(AlongFace(receivers.normal, face)) {}

  // Of places at `y` in a row of pixels.
  class Row {
   public:
    Row(const FaceWeights& face, int row, V y) : face_(face) {
      if (!face.weighs_) return;
      const V v = face.Slope(y), v_middle = face.Slope(Splat(float(row) + 0.5f));
      cosine_ = hn::MulAdd(face.up_.y, v, face.up_.z);
      cosine_middle_ = hn::MulAdd(face.up_.y, v_middle, face.up_.z);
      square_ = hn::MulAdd(v, v, Splat(1));
      square_middle_ = hn::MulAdd(v_middle, v_middle, Splat(1));
    }
    HWY_INLINE V At(int column, V x) const {
      if (!face_.weighs_) return Splat(1);
      const V u = face_.Slope(x), u_middle = face_.Slope(Splat(float(column) + 0.5f));
      const V square = hn::MulAdd(u, u, square_);
      const V square_middle = hn::MulAdd(u_middle, u_middle, square_middle_);
      V cosine = hn::MulAdd(face_.up_.x, u, cosine_);
      V cosine_middle = hn::MulAdd(face_.up_.x, u_middle, cosine_middle_);
      if (face_.is_any_spherical_) {
        cosine = hn::IfThenElse(face_.spherical_, hn::Sqrt(square), cosine);
        cosine_middle = hn::IfThenElse(face_.spherical_, hn::Sqrt(square_middle), cosine_middle);
      }
      const V whole = hn::Mul(hn::Max(cosine_middle, Splat(1e-20f)), hn::Mul(square, square));
      return hn::Div(hn::Mul(hn::Max(hn::Zero(D()), cosine), hn::Mul(square_middle, square_middle)),
                     whole);
    }

   private:
    const FaceWeights& face_;
    V cosine_, cosine_middle_, square_, square_middle_;
  };

 private:
  V Slope(V place) const { return hn::Mul(Splat(slope_), hn::Sub(place, Splat(middle_))); }

  bool weighs_ = false, is_any_spherical_ = false;
  M spherical_;
  float slope_ = 0, middle_ = 0;
  V3 up_;  // the receivers' normals along the axes of the face
};

// The samples of rows, or columns, of a face that lie between `low` and `high`, in pixels; half
// open.
struct SampleRun {
  using VI = hn::Vec<DI>;
  VI begin, end;

  SampleRun(V low, V high) {
    const V scale = Splat(float(kHullSide));
    begin = hn::ConvertTo(DI(), hn::Ceil(hn::Mul(scale, low)));
    end = hn::ConvertTo(DI(), hn::Floor(hn::Mul(scale, high)));
  }
  // Bits of those columns in a column of pixels.
  VU Columns(int pixel) const {
    const VU all = SplatU(kHullSamples);
    return hn::AndNot(hn::Shl(all, hn::ShiftLeft<2>(Within(end, pixel))),
                      hn::Shl(all, hn::ShiftLeft<2>(Within(begin, pixel))));
  }
  // Of those rows in a row of pixels.
  VU Rows(int pixel) const {
    const VU column = SplatU(0xf);
    const VU some = hn::AndNot(hn::Shl(column, Within(end, pixel)),
                               hn::And(column, hn::Shl(column, Within(begin, pixel))));
    return InEveryColumn(some);
  }

 private:
  static VU Within(VI at, int pixel) {
    const DI d;
    const VI first = hn::Set(d, kHullSide * pixel), most = hn::Set(d, kHullSide);
    return hn::BitCast(DU(), hn::Min(most, hn::Max(hn::Zero(d), hn::Sub(at, first))));
  }
};

// Of the hull of a patch, in samples. Spheres, two-sided surfels and rough nodes may stand alone,
// and are not widened.
inline VU Widening(const Parallelogram& shape, bool is_solid) {
  if (!is_solid) return hn::Zero(DU());
  const V side = hn::Sqrt(hn::Mul(shape.half_x, shape.half_y));
  const V samples =
      hn::MulAdd(side, Splat(kFidelity.hull_widening * float(kHullSide)), Splat(0.5f));
  const V within = hn::Min(Splat(float(kHullSide)), hn::Max(Splat(1), samples));
  return hn::BitCast(DU(), hn::ConvertTo(DI(), within));
}

// Adds the samples of the widened shape to the hull in lanes of `seen`, with the same shift for all
// of a row of pixels.
template <typename Hull>
HWY_INLINE void AddHull(const Hull& hull, const Parallelogram& shape, M seen, const Cover& cover,
                        int resolution, const SeenPixels::Face& face, OpenPixels& open) {
  const D d;
  const VU widening = Widening(shape, cover.is_solid);
  const V in_samples = hn::ConvertTo(d, hn::BitCast(DI(), widening));
  // Samples are of the hull as a whole or not at all: half of one is to spare, or else rounding
  // would tear tiles apart. (What stands alone has none: small balls would grow.)
  const V wider = cover.is_solid ? hn::MulAdd(in_samples, Splat(1 / float(kHullSide)),
                                              Splat(0.5f / float(kHullSide)))
                                 : hn::Zero(d);
  const V half_x = hn::Add(shape.half_x, wider), half_y = hn::Add(shape.half_y, wider);
  const V reach = hn::MulAdd(hn::Abs(shape.shear), shape.half_y, half_x);
  const FaceBox box(shape, reach, half_y, resolution, face, seen);
  if (box.range.isEmpty()) return;
  const auto counts = hn::RebindMask(DU(), seen);
  const SampleRun across(box.y0, box.y1);
  for (int row = box.range.row_begin; row < box.range.row_end; ++row) {
    const VU rows = hn::IfThenElseZero(counts, across.Rows(row));
    // The same shift for all of a row of pixels
    const V along = hn::Sub(Splat(float(row) + 0.5f), shape.y);
    const V within = hn::Min(shape.half_y, hn::Max(hn::Neg(shape.half_y), along));
    const V x = hn::MulAdd(shape.shear, within, shape.x);
    const SampleRun run(hn::Max(box.x0, hn::Sub(x, half_x)), hn::Min(box.x1, hn::Add(x, half_x)));
    open.DrawRow(box.range, row, resolution, [&](std::size_t pixel, int column) HWY_ATTR {
      return hull.Add(pixel, hn::And(rows, run.Columns(column)), widening, cover.hull_begin,
                      cover.hull_end);
    });
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
