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

// As HullRun: the first sample of 4 in a row or column at `at`, and the one behind the last.
inline VU Sample(V x) {
  const V within = hn::Min(Splat(float(kHullSide)), hn::Max(hn::Zero(D()), x));
  return hn::BitCast(DU(), hn::ConvertTo(DI(), within));
}
inline VU FirstSample(V low, float at) {
  const V samples = hn::Mul(Splat(float(kHullSide)), hn::Sub(low, Splat(at)));
  return Sample(hn::Ceil(hn::Sub(samples, Splat(0.5f))));
}
inline VU EndSample(V high, float at) {
  const V samples = hn::Mul(Splat(float(kHullSide)), hn::Sub(high, Splat(at)));
  return Sample(hn::Floor(hn::Add(samples, Splat(0.5f))));
}
// Bits [begin, end).
inline VU Bits(VU begin, VU end) {
  const VU bits = hn::Sub(hn::Shl(SplatU(1), end), hn::Shl(SplatU(1), begin));
  return hn::IfThenElseZero(hn::Lt(begin, end), bits);
}

// As hullWidening.
inline V Widening(const Parallelogram& shape, bool is_solid) {
  if (!is_solid) return hn::Zero(D());
  const V side = hn::Sqrt(hn::Mul(shape.half_x, shape.half_y));
  const V samples = hn::MulAdd(side, Splat(kHullWidening * float(kHullSide)), Splat(0.5f));
  return hn::Floor(hn::Min(Splat(float(kHullSide)), hn::Max(Splat(1), samples)));
}

// As RasterCube::addHull, in lanes of `seen` that hide enough.
template <typename Hull>
HWY_INLINE void AddHull(const Hull& hull, const Parallelogram& shape, M seen, const Cover& cover,
                        int resolution, const SeenPixels::Face& face) {
  const D d;
  const V zero = hn::Zero(d), size = Splat(float(resolution));
  const V widening = Widening(shape, cover.is_solid);
  const V wider = hn::Mul(widening, Splat(1 / float(kHullSide)));
  const V half_x = hn::Add(shape.half_x, wider), half_y = hn::Add(shape.half_y, wider);
  const V reach = hn::MulAdd(hn::Abs(shape.shear), shape.half_y, half_x);
  const V y0 = hn::Sub(shape.y, half_y), y1 = hn::Add(shape.y, half_y);
  const V left_in = hn::Max(zero, hn::Sub(shape.x, reach));
  const V right_in = hn::Min(size, hn::Add(shape.x, reach));
  const V low_in = hn::Max(zero, y0), high_in = hn::Min(size, y1);
  seen = hn::And(seen, hn::Ge(cover.opacity, Splat(kHullOpacity)));
  seen = hn::And(seen, hn::And(hn::Lt(left_in, right_in), hn::Lt(low_in, high_in)));
  if (hn::AllFalse(d, seen)) return;
  const PixelRange range = RangeOf(seen, left_in, right_in, low_in, high_in, resolution, face);
  if (range.isEmpty()) return;
  const auto counts = hn::RebindMask(DU(), seen);
  for (int row = range.row_begin; row < range.row_end; ++row) {
    const VU first = hn::ShiftLeft<2>(FirstSample(y0, float(row)));
    const VU end = hn::ShiftLeft<2>(EndSample(y1, float(row)));
    const VU rows = hn::IfThenElseZero(counts, Bits(first, end));
    // The same shift for all of a row of pixels
    const V along = hn::Sub(Splat(float(row) + 0.5f), shape.y);
    const V within = hn::Min(shape.half_y, hn::Max(hn::Neg(shape.half_y), along));
    const V x = hn::MulAdd(shape.shear, within, shape.x);
    const V left = hn::Sub(x, half_x), right = hn::Add(x, half_x);
    const auto [column_begin, column_end] = ColumnsOf(range, row, face);
    for (int column = column_begin; column < column_end; ++column) {
      const float at = float(column);
      VU samples = Bits(FirstSample(left, at), EndSample(right, at));
      samples = hn::Or(samples, hn::ShiftLeft<4>(samples));
      samples = hn::And(rows, hn::Or(samples, hn::ShiftLeft<8>(samples)));
      if (hn::AllFalse(DU(), hn::Ne(samples, hn::Zero(DU())))) continue;
      hull.Add(std::size_t(row * resolution + column), samples, widening, cover.depth_begin,
               cover.depth_end);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
