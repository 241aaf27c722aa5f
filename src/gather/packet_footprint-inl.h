// The samples that patches, widened, add to the hulls of a packet's rasters; for one instruction
// set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_FOOTPRINT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_FOOTPRINT_INL_H_
#undef SURFEIT_PACKET_FOOTPRINT_INL_H_
#else
#define SURFEIT_PACKET_FOOTPRINT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "gather/coverage_rules.h"
#include "gather/packet_cover-inl.h"
#include "gather/packet_hull-inl.h"
#include "gather/packet_kernel.h"
#include "gather/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// As RasterCube::Parallelogram, in pixels.
struct Parallelogram {
  V x, y, half_x, half_y, shear;
};

// The samples of rows, or columns, of a face that lie between `low` and `high`, in pixels; half
// open. As HullRun, but of all pixels at once.
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

// As hullWidening, in samples.
inline VU Widening(const Parallelogram& shape, bool is_solid) {
  if (!is_solid) return hn::Zero(DU());
  const V side = hn::Sqrt(hn::Mul(shape.half_x, shape.half_y));
  const V samples = hn::MulAdd(side, Splat(kHullWidening * float(kHullSide)), Splat(0.5f));
  const V within = hn::Min(Splat(float(kHullSide)), hn::Max(Splat(1), samples));
  return hn::BitCast(DU(), hn::ConvertTo(DI(), within));
}

// As RasterCube::addHull, in lanes of `seen`.
template <typename Hull>
HWY_INLINE void AddHull(const Hull& hull, const Parallelogram& shape, M seen, const Cover& cover,
                        int resolution, const SeenPixels::Face& face, OpenPixels& open) {
  const D d;
  const V zero = hn::Zero(d), size = Splat(float(resolution));
  const VU widening = Widening(shape, cover.is_solid);
  const V in_samples = hn::ConvertTo(d, hn::BitCast(DI(), widening));
  const V wider = cover.is_solid ? hn::MulAdd(in_samples, Splat(1 / float(kHullSide)),
                                              Splat(0.5f / float(kHullSide)))
                                 : hn::Zero(d);
  const V half_x = hn::Add(shape.half_x, wider), half_y = hn::Add(shape.half_y, wider);
  const V reach = hn::MulAdd(hn::Abs(shape.shear), shape.half_y, half_x);
  const V y0 = hn::Max(zero, hn::Sub(shape.y, half_y));
  const V y1 = hn::Min(size, hn::Add(shape.y, half_y));
  const V x0 = hn::Max(zero, hn::Sub(shape.x, reach));
  const V x1 = hn::Min(size, hn::Add(shape.x, reach));
  seen = hn::And(seen, hn::And(hn::Lt(x0, x1), hn::Lt(y0, y1)));
  if (hn::AllFalse(d, seen)) return;
  const PixelRange range = RangeOf(seen, x0, x1, y0, y1, resolution, face);
  if (range.isEmpty()) return;
  const auto counts = hn::RebindMask(DU(), seen);
  const SampleRun across(y0, y1);
  for (int row = range.row_begin; row < range.row_end; ++row) {
    const VU rows = hn::IfThenElseZero(counts, across.Rows(row));
    // The same shift for all of a row of pixels
    const V along = hn::Sub(Splat(float(row) + 0.5f), shape.y);
    const V within = hn::Min(shape.half_y, hn::Max(hn::Neg(shape.half_y), along));
    const V x = hn::MulAdd(shape.shear, within, shape.x);
    const SampleRun run(hn::Max(x0, hn::Sub(x, half_x)), hn::Min(x1, hn::Add(x, half_x)));
    open.DrawRow(range, row, resolution, [&](std::size_t pixel, int column) HWY_ATTR {
      return hull.Add(pixel, hn::And(rows, run.Columns(column)), widening, cover.depth_begin,
                      cover.depth_end);
    });
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
