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
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/packet_things-inl.h"
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
  VI begin = hn::Zero(DI()), end = begin;

  SampleRun() = default;
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

// How far the hull of a shape reaches beyond it.
struct Widening {
  VU samples = hn::Zero(DU());
  V pixels = hn::Zero(D());

  // Only tiles of surfaces are widened: spheres, rough nodes and leaves may stand alone. Samples
  // are of the hull as a whole or not at all: half of one is to spare, or else rounding would tear
  // tiles apart.
  Widening(const Parallelogram& shape, bool is_solid) {
    if (!is_solid) return;
    const D d;
    const V side = hn::Sqrt(hn::Mul(shape.half_x, shape.half_y));
    const V wide = hn::MulAdd(side, Splat(kFidelity.hull_widening * float(kHullSide)), Splat(0.5f));
    const V within = hn::Min(Splat(float(kHullSide)), hn::Max(Splat(1), wide));
    const auto whole = hn::ConvertTo(DI(), within);
    samples = hn::BitCast(DU(), whole);
    pixels = hn::Mul(hn::Add(hn::ConvertTo(d, whole), Splat(0.5f)), Splat(1 / float(kHullSide)));
  }
};

// The parts of pixels in a shape, row by row.
class AreaRows {
 public:
  AreaRows(const Parallelogram& shape, M seen, V opacity, int resolution)
      : shape_(shape),
        opacity_(opacity),
        half_x_(hn::IfThenElseZero(seen, shape.half_x)),  // 0: no width
        begin_(hn::Max(hn::Zero(D()), hn::Sub(shape.y, shape.half_y))),
        end_(hn::Min(Splat(float(resolution)), hn::Add(shape.y, shape.half_y))) {}

  // False: the shape does not reach the row.
  HWY_INLINE bool BeginRow(int row) {
    const V bottom = hn::Max(begin_, Splat(float(row)));
    const V top = hn::Min(end_, Splat(float(row + 1)));
    const V height = hn::Sub(top, bottom);
    if (hn::AllFalse(D(), hn::Gt(height, hn::Zero(D())))) return false;
    height_ = hn::Mul(opacity_, hn::Max(hn::Zero(D()), height));
    middle_y_ = hn::Mul(Splat(0.5f), hn::Add(top, bottom));
    const V x = hn::MulAdd(shape_.shear, hn::Sub(middle_y_, shape_.y), shape_.x);
    left_ = hn::Sub(x, half_x_);
    right_ = hn::Add(x, half_x_);
    bottom_ = bottom;
    top_ = top;
    return true;
  }
  // Of what is in a pixel: its part in these samples.
  HWY_NOINLINE V PartIn(VU samples, int row, int column) const {
    const D d;
    V heights[kHullSide], all_heights = hn::Zero(d), all_widths = all_heights, in_all = all_heights;
    for (int i = 0; i < kHullSide; ++i) {
      heights[i] = Within(bottom_, top_, row, i);
      all_heights = hn::Add(all_heights, heights[i]);
    }
    for (int j = 0; j < kHullSide; ++j) {
      V in_column = hn::Zero(d);
      for (int i = 0; i < kHullSide; ++i) {
        const auto has = hn::TestBit(samples, SplatU(1u << (kHullSide * j + i)));
        in_column = hn::Add(in_column, hn::IfThenElseZero(hn::RebindMask(d, has), heights[i]));
      }
      const V width = Within(left_, right_, column, j);
      in_all = hn::MulAdd(width, in_column, in_all);
      all_widths = hn::Add(all_widths, width);
    }
    return hn::Div(in_all, hn::Max(hn::Mul(all_widths, all_heights), Splat(1e-30f)));
  }
  V middleY() const { return middle_y_; }
  // Of a pixel of the row: its part, and where the middle of that lies.
  HWY_INLINE V Amount(int column, V& middle_x) const {
    const V right = hn::Min(right_, Splat(float(column + 1)));
    const V left = hn::Max(left_, Splat(float(column)));
    middle_x = hn::Mul(Splat(0.5f), hn::Add(right, left));
    return hn::Mul(height_, hn::Max(hn::Zero(D()), hn::Sub(right, left)));
  }

 private:
  // Of what is between `low` and `high`: how much lies in a column, or row, of a pixel's samples.
  static V Within(V low, V high, int pixel, int sample) {
    const float begin = float(pixel) + float(sample) / kHullSide, end = begin + 1.f / kHullSide;
    const V within = hn::Sub(hn::Min(high, Splat(end)), hn::Max(low, Splat(begin)));
    return hn::Max(hn::Zero(D()), within);
  }

  const Parallelogram& shape_;
  const V opacity_, half_x_, begin_, end_;
  V height_, middle_y_, left_, right_, bottom_, top_;
};

// The samples of pixels in a widened shape, row by row, with the same shift for all of a row of
// pixels.
class HullRows {
 public:
  HullRows(const Parallelogram& shape, M seen, V wider, const FaceBox& box)
      : shape_(shape),
        box_(box),
        wider_(wider),
        seen_(hn::RebindMask(DU(), seen)),
        across_(box.y0, box.y1) {}

  HWY_INLINE void BeginRow(int row) {
    rows_ = hn::IfThenElseZero(seen_, across_.Rows(row));
    const V along = hn::Sub(Splat(float(row) + 0.5f), shape_.y);
    const V within = hn::Min(shape_.half_y, hn::Max(hn::Neg(shape_.half_y), along));
    const V x = hn::MulAdd(shape_.shear, within, shape_.x), half = hn::Add(shape_.half_x, wider_);
    run_ = SampleRun(hn::Max(box_.x0, hn::Sub(x, half)), hn::Min(box_.x1, hn::Add(x, half)));
  }
  HWY_INLINE VU Samples(int column) const { return hn::And(rows_, run_.Columns(column)); }

 private:
  const Parallelogram& shape_;
  const FaceBox& box_;
  const V wider_;
  const hn::Mask<DU> seen_;
  const SampleRun across_;
  VU rows_ = hn::Zero(DU());
  SampleRun run_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
